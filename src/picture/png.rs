//! PNG: eight bits a channel, sRGB, provenance as text chunks, no times.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use ::png::{BitDepth, ColorType, Compression, Decoder, Encoder, Limits, SrgbRenderingIntent};
use ::png::{DecodingError, Transformations};
use glintmap_formats::seal;

use super::Error;
use super::channels::{check_length, check_size};
use crate::base::Grid;

/// Memory that the decoder may take beside the picture.
const DECODER_BYTES: usize = 64 << 20;

/// Writes a picture with text chunks (keyword and text, in order). The same input gives the same
/// bytes.
///
/// # Errors
/// [`Error::Setting`] for keywords that PNG doesn't take (empty, longer than 79 bytes, not Latin),
/// [`Error::TooLarge`], [`Error::Io`].
pub fn write(
    path: &Path,
    picture: &Grid<[u8; 3]>,
    texts: &[(String, String)],
) -> Result<(), Error> {
    let bytes = encode(path, picture, texts)?;
    seal::write_bytes(path, &bytes).map_err(Error::write(path))
}

fn encode(
    path: &Path,
    picture: &Grid<[u8; 3]>,
    texts: &[(String, String)],
) -> Result<Vec<u8>, Error> {
    let (columns, rows) = (picture.columns(), picture.rows());
    let tall = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
    if columns == 0 || rows == 0 {
        return Err(Error::unsupported(path, "a PNG needs at least one pixel"));
    }
    let grey = picture.data().iter().all(|p| p[0] == p[1] && p[1] == p[2]);
    let mut out = Vec::new();
    let mut encoder = Encoder::new(&mut out, tall(columns), tall(rows));
    encoder.set_color(if grey { ColorType::Grayscale } else { ColorType::Rgb });
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Balanced);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    for (keyword, text) in texts {
        let added = if text.is_ascii() {
            encoder.add_text_chunk(keyword.clone(), text.clone())
        } else {
            encoder.add_itxt_chunk(keyword.clone(), text.clone())
        };
        let fits = (1..80).contains(&keyword.len())
            && keyword.chars().all(|c| matches!(c, ' '..='~'))
            && !keyword.starts_with(' ')
            && !keyword.ends_with(' ');
        if added.is_err() || !fits || text.contains('\0') {
            return Err(Error::Setting {
                option: "text chunk",
                value: keyword.clone(),
                what: "PNG takes keywords of 1 to 79 Latin letters".into(),
            });
        }
    }
    let samples: Vec<u8> = if grey {
        picture.data().iter().map(|p| p[0]).collect()
    } else {
        picture.data().iter().flatten().copied().collect()
    };
    let done = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(&samples)?;
        writer.finish()
    });
    done.map_err(|e| Error::unsupported(path, format!("can't be written as PNG: {e}")))?;
    Ok(out)
}

/// A picture and its text chunks, keyword and text.
pub type Read = (Grid<[u8; 3]>, Vec<(String, String)>);

/// Reads any PNG as 8-bit RGB: deeper samples are cut to 8 bits, palettes looked up, transparency
/// is dropped.
///
/// # Errors
/// [`Error::Io`], [`Error::Malformed`], [`Error::TooLarge`].
pub fn read(path: &Path) -> Result<Read, Error> {
    let bytes = fs::read(path).map_err(Error::read(path))?;
    decode(path, &bytes)
}

/// [`read`] from memory; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Read, Error> {
    let said = |e: DecodingError| Error::malformed(path, format!("is no sound PNG file: {e}"));
    let limits = Limits { bytes: DECODER_BYTES };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(said)?;
    let (width, height) = reader.info().size();
    let size = (u64::from(width), u64::from(height), 3);
    let (columns, rows) = check_size(path, size.0, size.1, size.2)?;
    // Deflate packs at most 1032 bytes into one.
    let least = reader.info().raw_bytes() as u64 / 1040;
    check_length(path, size, least, bytes.len() as u64)?;
    let needed = reader.output_buffer_size();
    let needed = needed.ok_or_else(|| Error::malformed(path, "claims more than memory holds"))?;
    let mut buffer = vec![0; needed];
    let frame = reader.next_frame(&mut buffer).map_err(said)?;
    let step = frame.color_type.samples();
    let data: Vec<[u8; 3]> = buffer[..frame.buffer_size()]
        .chunks_exact(step)
        .map(|p| if step < 3 { [p[0]; 3] } else { [p[0], p[1], p[2]] })
        .collect();
    if data.len() != columns * rows {
        return Err(Error::malformed(path, "holds fewer pixels than its header says"));
    }
    let info = reader.info();
    let latin = info.uncompressed_latin1_text.iter().map(|t| (t.keyword.clone(), t.text.clone()));
    let wide = info.utf8_text.iter().filter_map(|t| Some((t.keyword.clone(), t.get_text().ok()?)));
    let texts = latin.chain(wide).collect();
    Ok((Grid::from_vec(columns, rows, data), texts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_and_texts_come_back() {
        let path = Path::new("memory.png");
        let color = Grid::from_vec(5, 4, (0..20).map(|i| [i * 9, 255 - i, i % 3]).collect());
        let grey = Grid::from_vec(3, 2, (0..6).map(|i| [i * 40; 3]).collect());
        let texts = [("Title", "plain"), ("Unit", "Wh/m², Fassade süd")]
            .map(|(k, v)| (k.to_owned(), v.to_owned()));
        for picture in [color, grey] {
            let bytes = encode(path, &picture, &texts).expect("encodes");
            assert_eq!(bytes, encode(path, &picture, &texts).expect("encodes"));
            let (back, read) = decode(path, &bytes).expect("decodes");
            assert!(back == picture);
            assert_eq!(read, texts);
        }
    }

    #[test]
    fn keywords_that_png_refuses_are_refused() {
        let picture = Grid::filled(2, 2, [1, 2, 3]);
        for key in ["", "Größe→", " x", &"k".repeat(80)] {
            let texts = [(key.to_owned(), "text".to_owned())];
            let result = encode(Path::new("x"), &picture, &texts);
            assert!(matches!(result, Err(Error::Setting { .. })), "{key:?}");
        }
    }
}
