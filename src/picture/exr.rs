//! OpenEXR: named channels of 32-bit floats, lossless (ZIP), rows from the top, text attributes.
//! The only file that knows the `exr` crate.

use std::collections::HashMap;
use std::fs;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, FlatSamples, Image,
    Layer, LayerAttributes, LineOrder, ReadChannels, ReadLayers, Text, Vec2, WritableImage,
};
use glintmap_formats::seal;

use super::Error;
use super::channels::{Channels, check_length, check_size};
use crate::base::Grid;

/// Longest name of an attribute or channel that every OpenEXR reader takes.
const MAX_NAME_BYTES: usize = 31;
/// Attribute names that OpenEXR uses itself.
const RESERVED: [&str; 14] = [
    "channels",
    "chunkCount",
    "compression",
    "dataWindow",
    "displayWindow",
    "lineOrder",
    "name",
    "owner",
    "pixelAspectRatio",
    "screenWindowCenter",
    "screenWindowWidth",
    "tiles",
    "type",
    "view",
];

/// Writes channels of equal size. The unit belongs in the channel's name (`annual.wh_m2`). The
/// same input gives the same bytes: attributes are sorted by name, nothing depends on threads.
///
/// # Errors
/// [`Error::Setting`] for names that OpenEXR doesn't take (empty, longer than 31 bytes, twice,
/// reserved), [`Error::Size`] for channels of different sizes, [`Error::Io`].
pub fn write(
    path: &Path,
    channels: &[(&str, &Grid<f32>)],
    attributes: &[(String, String)],
) -> Result<(), Error> {
    let bytes = encode(path, channels, attributes, true)?;
    seal::write_bytes(path, &bytes).map_err(Error::write(path))
}

/// [`write()`] for channels that are already together.
///
/// # Errors
/// As [`write()`].
pub fn write_channels(path: &Path, channels: &Channels) -> Result<(), Error> {
    let list: Vec<_> = channels.list().iter().map(|(n, g)| (n.as_str(), g)).collect();
    write(path, &list, &channels.attributes)
}

fn encode(
    path: &Path,
    channels: &[(&str, &Grid<f32>)],
    attributes: &[(String, String)],
    parallel: bool,
) -> Result<Vec<u8>, Error> {
    let Some(&(first, grid)) = channels.first() else {
        return Err(Error::unsupported(path, "an EXR needs at least one channel"));
    };
    let (columns, rows) = (grid.columns(), grid.rows());
    check_size(path, columns as u64, rows as u64, channels.len() as u64)?;
    check_names("channel", channels.iter().map(|(name, _)| *name), &[])?;
    check_names("attribute", attributes.iter().map(|(name, _)| name.as_str()), &RESERVED)?;
    let mut list = Vec::with_capacity(channels.len());
    for (name, grid) in channels {
        if (grid.columns(), grid.rows()) != (columns, rows) {
            return Err(Error::Size {
                what: format!("channel {name}"),
                found_columns: grid.columns(),
                found_rows: grid.rows(),
                columns,
                rows,
                of: format!("channel {first}"),
            });
        }
        list.push(AnyChannel::new(text(name), FlatSamples::F32(grid.data().to_vec())));
    }
    let other: HashMap<Text, AttributeValue> = attributes
        .iter()
        .map(|(name, value)| (text(name), AttributeValue::Text(text(value))))
        .collect();
    let layer = Layer::new(
        Vec2(columns, rows),
        LayerAttributes { other, ..LayerAttributes::default() },
        Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        },
        AnyChannels::sort(list.into()),
    );
    let image = Image::from_layer(layer);
    let mut out = Cursor::new(Vec::new());
    let writer = image.write();
    let done = if parallel {
        writer.to_buffered(&mut out)
    } else {
        writer.non_parallel().to_buffered(&mut out)
    };
    done.map_err(|e| Error::unsupported(path, format!("can't be written as EXR: {e}")))?;
    let mut bytes = out.into_inner();
    sort_attributes(&mut bytes);
    Ok(bytes)
}

/// UTF-8 bytes as they are: OpenEXR takes a string attribute for bytes.
fn text(value: &str) -> Text {
    Text::from_bytes_unchecked(value.as_bytes().into())
}

fn check_names<'a>(
    option: &'static str,
    names: impl Iterator<Item = &'a str>,
    reserved: &[&str],
) -> Result<(), Error> {
    let mut seen = Vec::new();
    for name in names {
        let wrong = if name.is_empty() || name.len() > MAX_NAME_BYTES || name.contains('\0') {
            "EXR names have 1 to 31 bytes"
        } else if reserved.contains(&name) {
            "the name belongs to OpenEXR itself"
        } else if seen.contains(&name) {
            "the name is there twice"
        } else {
            seen.push(name);
            continue;
        };
        return Err(Error::Setting { option, value: name.to_owned(), what: wrong.into() });
    }
    Ok(())
}

/// Sorts the attributes of a single-part file by name: the `exr` crate keeps them in a hash map
/// and writes them in an order that differs from run to run. The length stays, so no offset
/// moves.
fn sort_attributes(bytes: &mut [u8]) {
    const START: usize = 8;
    let mut at = START;
    let mut spans: Vec<(Vec<u8>, std::ops::Range<usize>)> = Vec::new();
    loop {
        let Some(name) = null_terminated(bytes, at) else { return };
        if name.is_empty() {
            break;
        }
        let name = name.to_vec();
        let kind_at = at + name.len() + 1;
        let Some(kind) = null_terminated(bytes, kind_at) else { return };
        let size_at = kind_at + kind.len() + 1;
        let Some(size) = bytes.get(size_at..size_at + 4) else { return };
        let size = u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize;
        let end = size_at + 4 + size;
        spans.push((name, at..end));
        at = end;
    }
    spans.sort_by(|a, b| a.0.cmp(&b.0));
    let sorted: Vec<u8> =
        spans.iter().flat_map(|(_, span)| bytes[span.clone()].iter().copied()).collect();
    bytes[START..START + sorted.len()].copy_from_slice(&sorted);
}

fn null_terminated(bytes: &[u8], at: usize) -> Option<&[u8]> {
    let rest = bytes.get(at..)?;
    rest.split(|&b| b == 0).next().filter(|name| name.len() < rest.len())
}

/// Reads every channel of an EXR as `f32`. The raster has the size of the display window; what
/// lies outside the data window is 0, what the data window has beyond it is cut off. Channels of
/// named layers are called `layer.channel`.
///
/// # Errors
/// [`Error::Io`], [`Error::Malformed`], [`Error::Unsupported`] (deep data, subsampled channels),
/// [`Error::TooLarge`] where the header claims more than the limits or the file's length allow.
pub fn read(path: &Path) -> Result<Channels, Error> {
    let bytes = fs::read(path).map_err(Error::read(path))?;
    decode(path, &bytes)
}

/// One channel of a file.
///
/// # Errors
/// As [`read`], or where the file has no such channel.
pub fn read_channel(path: &Path, channel: &str) -> Result<Grid<f32>, Error> {
    Ok(read(path)?.values(Some(channel), path)?.1)
}

/// [`read`] from memory; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Channels, Error> {
    // The decoder's arithmetic is checked in our builds: on hostile input it may stop itself with
    // a panic, which is no more than another way to say that the file is damaged.
    catch_unwind(AssertUnwindSafe(|| decode_unguarded(path, bytes)))
        .unwrap_or_else(|_| Err(Error::malformed(path, "is damaged: the EXR decoder gave up")))
}

fn decode_unguarded(path: &Path, bytes: &[u8]) -> Result<Channels, Error> {
    let said = |e: ::exr::error::Error| match e {
        ::exr::error::Error::NotSupported(what) => {
            Error::unsupported(path, format!("uses a part of OpenEXR that is not read: {what}"))
        }
        e => Error::malformed(path, format!("is no sound OpenEXR file: {e}")),
    };
    let meta = ::exr::meta::MetaData::read_from_buffered(bytes, false).map_err(said)?;
    let mut display = None;
    let mut samples = 0u64;
    for header in &meta.headers {
        if header.deep {
            return Err(Error::unsupported(path, "holds deep data; flatten it first"));
        }
        let size = |v: Vec2<usize>| (v.0 as u64, v.1 as u64);
        let (columns, rows) = size(header.layer_size);
        let channels = header.channels.list.len() as u64;
        check_size(path, columns, rows, channels)?;
        samples = samples.saturating_add(columns * rows * channels);
        for channel in &header.channels.list {
            if channel.sampling != Vec2(1, 1) {
                let name = &channel.name;
                return Err(Error::unsupported(
                    path,
                    format!("channel {name} is subsampled; write it at full resolution"),
                ));
            }
        }
        // Zip packs at most 1032 bytes into one, the lossy methods some tens; samples have at
        // least two bytes.
        let least = columns * rows * channels * 2 / 4096;
        check_length(path, (columns, rows, channels), least, bytes.len() as u64)?;
        let block = match header.blocks {
            ::exr::meta::BlockDescription::ScanLines => columns.saturating_mul(32),
            ::exr::meta::BlockDescription::Tiles(tiles) => {
                let (w, h) = size(tiles.tile_size);
                w.saturating_mul(h)
            }
        };
        check_size(path, block.div_ceil(65_536).max(1), block.min(65_536), channels)?;
        let window = header.shared_attributes.display_window;
        check_size(path, window.size.0 as u64, window.size.1 as u64, channels)?;
        display.get_or_insert(window);
    }
    let Some(display) = display else {
        return Err(Error::malformed(path, "holds no picture at all"));
    };
    let (columns, rows) = (display.size.0, display.size.1);
    let all = meta.headers.iter().map(|h| h.channels.list.len() as u64).sum::<u64>();
    check_size(path, columns as u64, rows as u64, all)?;
    let limit = 4 * crate::base::limits::MAX_VIEW_PIXELS as u64;
    if samples > limit {
        return Err(Error::malformed(path, format!("claims {samples} samples, at most {limit}")));
    }

    let image = ::exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(said)?;
    let mut out = Channels::new(columns, rows);
    for layer in &image.layer_data {
        let Vec2(width, height) = layer.size;
        // Both windows are given by corners in one plane: where the data begin in the display.
        let corner = layer.attributes.layer_position;
        let left = i64::from(corner.0) - i64::from(display.position.0);
        let top = i64::from(corner.1) - i64::from(display.position.1);
        let prefix = layer.attributes.layer_name.as_ref().map(ToString::to_string);
        for channel in &layer.channel_data.list {
            let name = match &prefix {
                Some(layer) if !layer.is_empty() => format!("{layer}.{}", channel.name),
                _ => channel.name.to_string(),
            };
            let mut grid = Grid::filled(columns, rows, 0.0f32);
            let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
            for row in 0..height {
                let Ok(y) = usize::try_from(top + row as i64) else { continue };
                if y >= rows {
                    break;
                }
                for column in 0..width {
                    let Ok(x) = usize::try_from(left + column as i64) else { continue };
                    if x >= columns {
                        break;
                    }
                    grid[(x, y)] = values[row * width + column];
                }
            }
            out.push(&name, grid);
        }
        for (name, value) in &layer.attributes.other {
            if let AttributeValue::Text(value) = value {
                let value = String::from_utf8_lossy(value.as_slice()).into_owned();
                out.attributes.push((name.to_string(), value));
            }
        }
    }
    out.attributes.sort();
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> (Grid<f32>, Grid<f32>) {
        let a = Grid::from_vec(37, 45, (0..37 * 45u32).map(|i| (i as f32).sqrt() * 0.37).collect());
        let special = [0.0, -0.0, f32::MIN_POSITIVE, 1e-42, f32::MAX, f32::INFINITY, -3.5];
        let b = Grid::from_vec(37, 45, (0..37 * 45).map(|i| special[i % 7]).collect());
        (a, b)
    }

    fn attributes() -> Vec<(String, String)> {
        ["zeta", "settings", "program", "unit", "alpha", "inputs", "mid"]
            .map(|name| (name.to_owned(), format!("value of {name}, 3 W/m²")))
            .to_vec()
    }

    #[test]
    fn what_is_written_is_read_to_the_bit() {
        let (a, b) = sample();
        let path = Path::new("memory.exr");
        let bytes =
            encode(path, &[("b.w_m2", &b), ("a.wh_m2", &a)], &attributes(), true).expect("encodes");
        let back = decode(path, &bytes).expect("decodes");
        let bits = |g: &Grid<f32>| g.data().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(back.list().len(), 2);
        assert_eq!(bits(back.get("a.wh_m2").expect("a")), bits(&a));
        assert_eq!(bits(back.get("b.w_m2").expect("b")), bits(&b));
        let mut expected = attributes();
        expected.sort();
        assert_eq!(back.attributes, expected);
    }

    #[test]
    fn the_same_input_gives_the_same_bytes() {
        let (a, b) = sample();
        let path = Path::new("memory.exr");
        let channels = [("a", &a), ("b", &b)];
        let first = encode(path, &channels, &attributes(), true).expect("encodes");
        for parallel in [true, false, true, true] {
            // Each encoding has a hash map with keys of its own.
            let again = encode(path, &channels, &attributes(), parallel).expect("encodes");
            assert!(first == again, "bytes differ");
        }
    }

    #[test]
    fn names_that_openexr_refuses_are_refused() {
        let (a, _) = sample();
        let path = Path::new("memory.exr");
        for name in ["", "a name that is too long for OpenEXR", "x\0y"] {
            assert!(matches!(encode(path, &[(name, &a)], &[], false), Err(Error::Setting { .. })));
        }
        let twice = encode(path, &[("a", &a), ("a", &a)], &[], false);
        assert!(matches!(twice, Err(Error::Setting { .. })));
        let small = Grid::filled(3, 3, 0.0f32);
        let sizes = encode(path, &[("a", &a), ("b", &small)], &[], false);
        assert!(matches!(sizes, Err(Error::Size { .. })));
    }
}
