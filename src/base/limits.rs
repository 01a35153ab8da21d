//! Every bound that the program puts on its input, in one place. A number read from a file is a
//! claim; it is held against these before it sizes an allocation.

/// Triangles in a scene.
pub const MAX_TRIANGLES: usize = 32_000_000;
/// Longest flight of light from the PV, m: beyond, single precision loses the receivers.
pub const MAX_PATH_M: f64 = 1e6;
/// Vertices of one polygon with its holes: cutting it up takes time with their square at worst.
pub const MAX_POLYGON_VERTICES: usize = 20_000;
/// PV surfaces: a photon carries the surface's number as u16.
pub const MAX_PV_SURFACES: usize = 65_535;
/// Timesteps in a year: one a second would be 31.5 million.
pub const MAX_TIMESTEPS: usize = 16_000_000;
/// Pixels along one edge of a view.
pub const MAX_VIEW_EDGE: usize = 65_536;
/// Pixels of a view.
pub const MAX_VIEW_PIXELS: usize = 64_000_000;
/// Photons that a store may hold.
pub const MAX_PHOTONS: u64 = 1 << 40;
/// Bytes of text header at the start of a file of ours.
pub const MAX_HEADER_BYTES: usize = 1 << 20;
/// Bytes of a scene, material or project file that is read whole.
pub const MAX_TEXT_FILE_BYTES: u64 = 4 << 30;
/// Copies that one `!xform` array may make.
pub const MAX_XFORM_COPIES: u64 = 100_000;
/// Bytes of scene text that commands of one Radiance file may expand to.
pub const MAX_EXPANDED_BYTES: u64 = 1 << 30;
/// How deep scene files may name each other.
pub const MAX_NESTING: usize = 24;
/// Heights of a terrain grid that are kept after clipping.
pub const MAX_GRID_CELLS: usize = 64_000_000;
/// Edge of the tiles in which views are rendered and volumes are stored, pixels.
pub const TILE_EDGE: usize = 32;
/// Bits of mantissa of a 32-bit float, the leading one aside: a time series that keeps so many is
/// exact.
pub const EXACT_MANTISSA_BITS: u32 = f32::MANTISSA_DIGITS - 1;
/// Findings that are printed before "and N more".
pub const MAX_FINDINGS_SHOWN: usize = 20;

const _: () = assert!(MAX_PV_SURFACES <= u16::MAX as usize);
const _: () = assert!(TILE_EDGE * TILE_EDGE <= u16::MAX as usize + 1);
const _: () = assert!(MAX_TIMESTEPS < u32::MAX as usize);
