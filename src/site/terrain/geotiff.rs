//! GeoTIFF: heights, where they stand, and the units that are refused.

use std::io::Cursor;

use glam::{DMat2, DVec2};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::grid::{Grid, Layout, Region};

/// Most columns or rows.
const MAX_EDGE: u32 = 1_000_000;
/// Largest strip or tile that is decoded, bytes.
const MAX_CHUNK_BYTES: usize = 1 << 28;

/// Keys of the geographic directory (OGC GeoTIFF 1.1, chapter 7).
const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const PROJECTED_CRS: u16 = 3072;
const LINEAR_UNIT: u16 = 3076;
const VERTICAL_UNIT: u16 = 4099;
const METRE: u16 = 9001;

/// Reads a GeoTIFF of heights: one band, any sample type, strips or tiles.
///
/// Where a height stands: raster coordinates (0, 0) are the outer corner of the first cell where
/// pixels are areas, so its height stands at (0.5, 0.5); where pixels are points they are that
/// point.
pub(in crate::site) fn read(bytes: &[u8], region: Option<Region>) -> Result<Grid, String> {
    let failed = |e: tiff::TiffError| format!("not a TIFF that can be read: {e}");
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_CHUNK_BYTES;
    limits.intermediate_buffer_size = MAX_CHUNK_BYTES;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(failed)?.with_limits(limits);
    let (columns, rows) = decoder.dimensions().map_err(failed)?;
    if columns == 0 || rows == 0 || columns > MAX_EDGE || rows > MAX_EDGE {
        return Err(format!("{columns} x {rows} heights; expected 1 to {MAX_EDGE} each way"));
    }
    match decoder.colortype().map_err(failed)? {
        ColorType::Gray(_) | ColorType::Palette(_) => {}
        other => {
            return Err(format!("expected one band of heights, found {other:?}: is it a picture?"));
        }
    }
    let keys = keys(&decoder.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap_or_default());
    let key = |id| keys.iter().find(|k| k.0 == id).map(|k| k.1);
    if key(MODEL_TYPE) == Some(2) {
        return Err("its coordinates are degrees; expected metres: reproject it (for example with gdalwarp -t_srs)".to_owned());
    }
    for (what, id) in [("horizontal", LINEAR_UNIT), ("vertical", VERTICAL_UNIT)] {
        if let Some(unit) = key(id).filter(|&unit| unit != METRE) {
            return Err(format!(
                "its {what} unit has the EPSG code {unit}; expected metres ({METRE}): convert it"
            ));
        }
    }
    let is_point = key(RASTER_TYPE) == Some(2);
    let layout = layout(&mut decoder, columns as usize, rows as usize, is_point)?;
    let window = layout.window(region)?;
    let nodata = decoder.get_tag_ascii_string(Tag::GdalNodata).ok();
    let nodata = nodata.and_then(|t| t.trim_matches(['\0', ' ']).parse::<f64>().ok());
    let part = layout.part(&window);
    let mut heights = vec![f32::NAN; part.columns * part.rows];
    let (width, height) = decoder.chunk_dimensions();
    if width == 0 || height == 0 {
        return Err("its strips or tiles have no size".to_owned());
    }
    let across = columns.div_ceil(width);
    for down in 0..rows.div_ceil(height) {
        for right in 0..across {
            let (x0, y0) =
                (u64::from(right) * u64::from(width), u64::from(down) * u64::from(height));
            let (x0, y0) = (x0 as usize, y0 as usize);
            let apart = x0 >= window[0].end
                || y0 >= window[1].end
                || x0 + width as usize <= window[0].start
                || y0 + height as usize <= window[1].start;
            if apart {
                continue;
            }
            let index = down * across + right;
            let (w, h) = decoder.chunk_data_dimensions(index);
            let values = decoder.read_chunk(index).map_err(failed)?;
            let count = length(&values);
            if count < w as usize * h as usize {
                return Err(format!(
                    "strip or tile {index} holds {count} heights, expected {}",
                    w as usize * h as usize
                ));
            }
            for y in 0..h as usize {
                for x in 0..w as usize {
                    if !window[0].contains(&(x0 + x)) || !window[1].contains(&(y0 + y)) {
                        continue;
                    }
                    let value = value(&values, y * w as usize + x);
                    let there = Some(value) != nodata && value.abs() < 1e6;
                    let at = (y0 + y - window[1].start) * part.columns + x0 + x - window[0].start;
                    heights[at] = if there { value as f32 } else { f32::NAN };
                }
            }
        }
    }
    let crs = key(PROJECTED_CRS).filter(|&c| c != 32767).map(|code| format!("EPSG:{code}"));
    Ok(Grid { layout: part, heights, whole: [columns as usize, rows as usize], crs })
}

/// Short values of the directory: number, location 0, count 1, value.
fn keys(words: &[u16]) -> Vec<(u16, u16)> {
    let entries = words.get(4..).unwrap_or_default().chunks_exact(4);
    entries.filter(|e| e[1] == 0).map(|e| (e[0], e[3])).collect()
}

fn layout(
    decoder: &mut Decoder<Cursor<&[u8]>>,
    columns: usize,
    rows: usize,
    is_point: bool,
) -> Result<Layout, String> {
    let mut tag = |tag| decoder.get_tag_f64_vec(tag).unwrap_or_default();
    let matrix = tag(Tag::ModelTransformationTag);
    let (scale, ties) = (tag(Tag::ModelPixelScaleTag), tag(Tag::ModelTiepointTag));
    let (origin, axes) = if let [a, b, _, d, e, f, _, h, ..] = matrix[..] {
        (DVec2::new(d, h), DMat2::from_cols(DVec2::new(a, e), DVec2::new(b, f)))
    } else if let ([sx, sy, ..], [i, j, _, x, y, _, rest @ ..]) = (&scale[..], &ties[..]) {
        if !rest.is_empty() {
            return Err(
                "it has several tie points: resample it to a regular grid (gdalwarp)".to_owned()
            );
        }
        let axes = DMat2::from_diagonal(DVec2::new(*sx, -*sy));
        (DVec2::new(*x, *y) - axes * DVec2::new(*i, *j), axes)
    } else {
        return Err("it doesn't say where it lies: expected a tie point with a pixel scale, or a transformation matrix (a world file isn't read)".to_owned());
    };
    let first = if is_point { DVec2::ZERO } else { DVec2::splat(0.5) };
    Ok(Layout { origin: origin + axes * first, axes, columns, rows })
}

fn length(values: &DecodingResult) -> usize {
    match values {
        DecodingResult::U8(v) => v.len(),
        DecodingResult::I8(v) => v.len(),
        DecodingResult::U16(v) => v.len(),
        DecodingResult::I16(v) => v.len(),
        DecodingResult::U32(v) => v.len(),
        DecodingResult::I32(v) => v.len(),
        DecodingResult::U64(v) => v.len(),
        DecodingResult::I64(v) => v.len(),
        DecodingResult::F16(v) => v.len(),
        DecodingResult::F32(v) => v.len(),
        DecodingResult::F64(v) => v.len(),
    }
}

fn value(values: &DecodingResult, i: usize) -> f64 {
    match values {
        DecodingResult::U8(v) => f64::from(v[i]),
        DecodingResult::I8(v) => f64::from(v[i]),
        DecodingResult::U16(v) => f64::from(v[i]),
        DecodingResult::I16(v) => f64::from(v[i]),
        DecodingResult::U32(v) => f64::from(v[i]),
        DecodingResult::I32(v) => f64::from(v[i]),
        DecodingResult::U64(v) => v[i] as f64,
        DecodingResult::I64(v) => v[i] as f64,
        DecodingResult::F16(v) => f64::from(f32::from(v[i])),
        DecodingResult::F32(v) => f64::from(v[i]),
        DecodingResult::F64(v) => v[i],
    }
}
