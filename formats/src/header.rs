#![doc = include_str!("header.md")]

use std::io::{self, Read, Write};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::checksum::crc32c;

const LINE_MAX: usize = 80;
const TRAILER: usize = 16;
const MAX: usize = 1 << 20;

/// Why a header can't be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It isn't a file of the expected kind.
    #[error("expected a file that begins with `glintmap {expected}`, found `{found}`")]
    NotOurs {
        /// The name of the format that was asked for.
        expected: &'static str,
        /// How the file begins.
        found: String,
    },
    /// A version that this program doesn't know.
    #[error(
        "`{name}` version {found}; this program reads version {known}: use the glintmap that wrote it, or make the file again"
    )]
    Version {
        /// The format.
        name: &'static str,
        /// What the file says.
        found: u32,
        /// What this program reads.
        known: u32,
    },
    /// The header is damaged.
    #[error("header of `{name}` is damaged: {what}")]
    Damaged {
        /// The format.
        name: &'static str,
        /// What doesn't hold.
        what: String,
    },
}

/// Writes a header and returns its length in bytes.
///
/// # Errors
/// Whatever the writer says.
pub fn write<T: Serialize>(
    out: &mut impl Write,
    name: &'static str,
    version: u32,
    facts: &T,
) -> io::Result<usize> {
    write_padded(out, name, version, facts, 0)
}

/// [`write()`], filled up to at least `reserved` bytes (a multiple of 64): for formats that learn
/// some of their facts only while they write what follows the header, and put it in front then.
///
/// # Errors
/// Whatever the writer says.
pub fn write_padded<T: Serialize>(
    out: &mut impl Write,
    name: &'static str,
    version: u32,
    facts: &T,
    reserved: usize,
) -> io::Result<usize> {
    let json = serde_json::to_string_pretty(facts)?;
    let least = LINE_MAX + json.len() + 1 + TRAILER;
    let length = least.next_multiple_of(64).max(reserved);
    if length > MAX {
        return Err(io::Error::other(format!("header of {length} bytes, at most {MAX}")));
    }
    let mut text = format!("glintmap {name} {version} {length:08}\n{json}\n");
    while text.len() < length - TRAILER {
        text.push(' ');
    }
    let sum = crc32c(text.as_bytes());
    text.push_str(&format!("crc32c {sum:08x}\n"));
    out.write_all(text.as_bytes())?;
    Ok(length)
}

/// Reads a header and returns its facts and its length in bytes.
///
/// # Errors
/// See [`Error`].
pub fn read<T: DeserializeOwned>(
    input: &mut impl Read,
    name: &'static str,
    version: u32,
) -> Result<(T, usize), Error> {
    let mut line = Vec::new();
    let mut byte = [0u8; 1];
    while line.len() < LINE_MAX && line.last() != Some(&b'\n') {
        match input.read(&mut byte)? {
            0 => break,
            _ => line.push(byte[0]),
        }
    }
    let first = String::from_utf8_lossy(&line).into_owned();
    let begins = format!("glintmap {name} ");
    let Some(rest) = first.strip_prefix(&begins) else {
        return Err(Error::NotOurs {
            expected: name,
            found: first.trim_end().chars().take(40).collect(),
        });
    };
    let damaged = |what: &str| Error::Damaged { name, what: what.to_owned() };
    let mut words = rest.trim_end().split(' ');
    let found: u32 = words
        .next()
        .and_then(|w| w.parse().ok())
        .ok_or_else(|| damaged("its first line holds no version"))?;
    if found != version {
        return Err(Error::Version { name, found, known: version });
    }
    let length: usize = words
        .next()
        .and_then(|w| w.parse().ok())
        .ok_or_else(|| damaged("its first line holds no length"))?;
    if length > MAX || length < line.len() + TRAILER {
        return Err(damaged(&format!("it claims {length} bytes, allowed are up to {MAX}")));
    }
    let mut text = line;
    let start = text.len();
    text.resize(length, 0);
    input.read_exact(&mut text[start..]).map_err(|e| match e.kind() {
        io::ErrorKind::UnexpectedEof => damaged("the file ends inside it"),
        _ => Error::Io(e),
    })?;
    let (body, trailer) = text.split_at(length - TRAILER);
    if trailer != format!("crc32c {:08x}\n", crc32c(body)).as_bytes() {
        return Err(damaged("its checksum doesn't hold"));
    }
    let facts = serde_json::from_slice(&body[start..]).map_err(|e| damaged(&e.to_string()))?;
    Ok((facts, length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_every_flipped_bit_is_found() {
        let facts = serde_json::json!({"photons": 12, "unit": "W/m²"});
        let mut bytes = Vec::new();
        let length = write(&mut bytes, "test", 3, &facts).expect("writes");
        assert_eq!((bytes.len(), length % 64), (length, 0));
        let (back, read_length): (serde_json::Value, _) =
            read(&mut bytes.as_slice(), "test", 3).expect("reads");
        assert_eq!((back, read_length), (facts, length));
        for at in 0..bytes.len() {
            let mut broken = bytes.clone();
            broken[at] ^= 1;
            let result: Result<(serde_json::Value, usize), _> =
                read(&mut broken.as_slice(), "test", 3);
            assert!(result.is_err(), "a flipped bit in byte {at} went unnoticed");
            let short = &bytes[..at];
            assert!(read::<serde_json::Value>(&mut &short[..], "test", 3).is_err());
        }
    }
}
