//! NumPy's `.npy`, format versions 1 to 3
//! (<https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>): little-endian,
//! C-order arrays of plain numbers. What is written equals `numpy.save` byte for byte.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::marker::PhantomData;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use crate::seal;

/// What every `.npy` file begins with.
pub const MAGIC: &[u8; 6] = b"\x93NUMPY";
const MAX_HEADER_BYTES: usize = 1 << 20;
const MAX_DIMENSIONS: usize = 32;
/// numpy leaves room for a first axis of this many digits to grow into.
const GROWTH_DIGITS: usize = 21;
const BLOCK_BYTES: usize = 1 << 18;

/// Why an array can't be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It isn't `.npy`, or a version that numpy doesn't have.
    #[error("expected an .npy file of version 1, 2 or 3, found {found}")]
    NotNpy {
        /// How the file begins.
        found: String,
    },
    /// The header doesn't follow the format.
    #[error("the .npy header is broken: {what}")]
    Header {
        /// What doesn't hold, and where.
        what: String,
    },
    /// Numbers of another kind.
    #[error(
        "expected numbers of type `{expected}`, found `{found}`: save it with .astype('{expected}')"
    )]
    Type {
        /// numpy's name of the expected type.
        expected: &'static str,
        /// What the header says.
        found: String,
    },
    /// Column-major order.
    #[error(
        "expected C order (fortran_order: False), found Fortran order: save np.ascontiguousarray(a)"
    )]
    FortranOrder,
    /// Another number of dimensions.
    #[error("expected an array of {expected} dimensions, found shape {found}")]
    Dimensions {
        /// What was asked for.
        expected: usize,
        /// The shape that the header claims, as numpy writes it.
        found: String,
    },
    /// The file is shorter or longer than its shape says.
    #[error("shape {shape} needs {expected} bytes of numbers, the file holds {found}")]
    Length {
        /// The shape that the header claims, as numpy writes it.
        shape: String,
        /// Bytes that follow from the shape, or "too many".
        expected: String,
        /// Bytes behind the header.
        found: u64,
    },
    /// Numbers outside the array were asked for, or more or fewer written than it has.
    #[error("numbers {first}..{end} of an array of {len}")]
    Range {
        /// First number.
        first: u64,
        /// Behind the last number.
        end: u64,
        /// Numbers in the array.
        len: u64,
    },
}

/// A number that `.npy` files of ours hold.
pub trait Value: Copy + Default {
    /// numpy's name of the type, as it stands in the header.
    const DESCR: &str;
    /// Bytes of one number.
    const BYTES: usize;
    /// The number that `bytes` (exactly [`Self::BYTES`] of them) hold.
    fn from_le(bytes: &[u8]) -> Self;
    /// Appends the number's bytes.
    fn put_le(self, out: &mut Vec<u8>);
}

macro_rules! values {
    ($($type:ty, $descr:literal, $bytes:literal;)*) => {$(
        impl Value for $type {
            const DESCR: &str = $descr;
            const BYTES: usize = $bytes;
            fn from_le(bytes: &[u8]) -> Self {
                let mut own = [0u8; $bytes];
                own.copy_from_slice(bytes);
                Self::from_le_bytes(own)
            }
            fn put_le(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
values! {
    f32, "<f4", 4;
    f64, "<f8", 8;
    i32, "<i4", 4;
    i64, "<i8", 8;
    u32, "<u4", 4;
    u64, "<u8", 8;
    i16, "<i2", 2;
    u16, "<u2", 2;
    i8, "|i1", 1;
    u8, "|u1", 1;
}

/// What an `.npy` file says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// numpy's name of the numbers' type: `<f4`.
    pub descr: String,
    /// Whether the first axis varies fastest.
    pub fortran_order: bool,
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// Where the numbers begin, bytes from the start of the file.
    pub data_offset: u64,
}

impl Header {
    /// Reads the header; the reader then stands at the first number.
    ///
    /// # Errors
    /// [`Error::NotNpy`], [`Error::Header`].
    pub fn read(input: &mut impl Read) -> Result<Self, Error> {
        let mut start = Vec::with_capacity(12);
        input.take(8).read_to_end(&mut start)?;
        if start.len() < 8 || &start[..6] != MAGIC {
            let shown = start.escape_ascii().to_string();
            let found = if start.is_empty() { "nothing".into() } else { format!("`{shown}`") };
            return Err(Error::NotNpy { found });
        }
        let length_bytes = match (start[6], start[7]) {
            (1, 0) => 2,
            (2 | 3, 0) => 4,
            (a, b) => return Err(Error::NotNpy { found: format!("version {a}.{b}") }),
        };
        let mut length = [0u8; 4];
        exactly(input, &mut length[..length_bytes])?;
        let length = u32::from_le_bytes(length);
        let bytes = usize::try_from(length).unwrap_or(usize::MAX);
        if bytes > MAX_HEADER_BYTES {
            return Err(broken(format!("it claims {length} bytes, at most {MAX_HEADER_BYTES}")));
        }
        let mut text = vec![0u8; bytes];
        exactly(input, &mut text)?;
        let text = String::from_utf8(text).map_err(|_| broken("it isn't text"))?;
        let (descr, fortran_order, shape) = Literal { text: &text, at: 0 }.header()?;
        let data_offset = 8 + length_bytes as u64 + u64::from(length);
        Ok(Self { descr, fortran_order, shape, data_offset })
    }

    /// How many numbers the shape claims; `None` where that overflows.
    pub fn len(&self) -> Option<u64> {
        self.shape.iter().try_fold(1u64, |n, &d| n.checked_mul(u64::try_from(d).ok()?))
    }

    /// Whether the array has no numbers.
    pub fn is_empty(&self) -> bool {
        self.shape.contains(&0)
    }
}

fn exactly(input: &mut impl Read, out: &mut [u8]) -> Result<(), Error> {
    input.read_exact(out).map_err(|e| match e.kind() {
        io::ErrorKind::UnexpectedEof => broken("the file ends inside it"),
        _ => Error::Io(e),
    })
}

fn broken(what: impl Into<String>) -> Error {
    Error::Header { what: what.into() }
}

/// A shape as Python writes it: `(3, 4)`, `(3,)`, `()`.
pub fn shape_text(shape: &[usize]) -> String {
    match shape {
        [only] => format!("({only},)"),
        _ => {
            let words: Vec<String> = shape.iter().map(ToString::to_string).collect();
            format!("({})", words.join(", "))
        }
    }
}

/// The Python literal of the header, of which only what numpy itself writes is understood.
struct Literal<'a> {
    text: &'a str,
    at: usize,
}

impl Literal<'_> {
    fn header(&mut self) -> Result<(String, bool, Vec<usize>), Error> {
        let (mut descr, mut order, mut shape) = (None, None, None);
        self.expect('{')?;
        while !self.accept('}') {
            let key = self.string()?;
            self.expect(':')?;
            match key.as_str() {
                "descr" => descr = Some(self.descr()?),
                "fortran_order" => order = Some(self.boolean()?),
                "shape" => shape = Some(self.shape()?),
                _ => return Err(self.fail(&format!("unknown key `{key}`"))),
            }
            if !self.accept(',') {
                self.expect('}')?;
                break;
            }
        }
        self.skip_space();
        if self.at != self.text.len() {
            return Err(self.fail("expected the end"));
        }
        match (descr, order, shape) {
            (Some(descr), Some(order), Some(shape)) => Ok((descr, order, shape)),
            _ => Err(broken("expected the keys `descr`, `fortran_order` and `shape`")),
        }
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn skip_space(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    fn accept(&mut self, sign: char) -> bool {
        self.skip_space();
        let found = self.rest().starts_with(sign);
        if found {
            self.at += sign.len_utf8();
        }
        found
    }

    fn expect(&mut self, sign: char) -> Result<(), Error> {
        if self.accept(sign) { Ok(()) } else { Err(self.fail(&format!("expected `{sign}`"))) }
    }

    fn fail(&self, what: &str) -> Error {
        let found: String = self.rest().chars().take(20).collect();
        broken(format!("{what} at character {}, found `{}`", self.at, found.trim_end()))
    }

    fn string(&mut self) -> Result<String, Error> {
        let quote = if self.accept('\'') {
            '\''
        } else if self.accept('"') {
            '"'
        } else {
            return Err(self.fail("expected a string"));
        };
        let Some(end) = self.rest().find(quote) else {
            return Err(self.fail("a string without an end"));
        };
        let out = self.rest()[..end].to_owned();
        self.at += end + 1;
        Ok(out)
    }

    /// A type name; a record type (a list) is kept as text, so that the error can show it.
    fn descr(&mut self) -> Result<String, Error> {
        if !self.accept('[') {
            return self.string();
        }
        let Some(end) = self.rest().rfind(']') else {
            return Err(self.fail("a list without an end"));
        };
        let out = format!("[{}]", &self.rest()[..end]);
        self.at += end + 1;
        Ok(out)
    }

    fn boolean(&mut self) -> Result<bool, Error> {
        self.skip_space();
        for (word, value) in [("True", true), ("False", false)] {
            if self.rest().starts_with(word) {
                self.at += word.len();
                return Ok(value);
            }
        }
        Err(self.fail("expected True or False"))
    }

    fn shape(&mut self) -> Result<Vec<usize>, Error> {
        let mut out = Vec::new();
        self.expect('(')?;
        while !self.accept(')') {
            self.skip_space();
            let digits = self.rest().chars().take_while(char::is_ascii_digit).count();
            let Ok(length) = self.rest()[..digits].parse() else {
                return Err(self.fail("expected a length"));
            };
            self.at += digits;
            // Python 2 wrote long integers with an L.
            self.accept('L');
            out.push(length);
            if out.len() > MAX_DIMENSIONS {
                return Err(self.fail(&format!("more than {MAX_DIMENSIONS} dimensions")));
            }
            if !self.accept(',') {
                self.expect(')')?;
                break;
            }
        }
        Ok(out)
    }
}

/// An open `.npy` file of `T`s, whose length was held against its shape. Numbers are read where
/// they are asked for, so an array may be larger than memory.
#[derive(Debug)]
pub struct Reader<T> {
    file: File,
    shape: Vec<usize>,
    len: u64,
    data_offset: u64,
    kind: PhantomData<fn() -> T>,
}

impl<T: Value> Reader<T> {
    /// Opens an array.
    ///
    /// # Errors
    /// Another type or order, or a file that doesn't hold exactly what its shape says.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let mut file = File::open(path)?;
        let header = Header::read(&mut file)?;
        Self::from_header(file, header)
    }

    fn from_header(file: File, header: Header) -> Result<Self, Error> {
        if header.descr.trim_start_matches('|') != T::DESCR.trim_start_matches('|') {
            return Err(Error::Type { expected: T::DESCR, found: header.descr });
        }
        if header.fortran_order && header.shape.len() > 1 {
            return Err(Error::FortranOrder);
        }
        let found = file.metadata()?.len().saturating_sub(header.data_offset);
        let bytes = header.len().and_then(|n| n.checked_mul(T::BYTES as u64));
        if bytes != Some(found) {
            let expected = bytes.map_or_else(|| "too many".to_owned(), |b| b.to_string());
            return Err(Error::Length { shape: shape_text(&header.shape), expected, found });
        }
        let len = found / T::BYTES as u64;
        let Header { shape, data_offset, .. } = header;
        Ok(Self { file, shape, len, data_offset, kind: PhantomData })
    }

    /// Length along each axis.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The shape, where it has `N` dimensions.
    ///
    /// # Errors
    /// [`Error::Dimensions`].
    pub fn shape_of<const N: usize>(&self) -> Result<[usize; N], Error> {
        self.shape
            .as_slice()
            .try_into()
            .map_err(|_| Error::Dimensions { expected: N, found: shape_text(&self.shape) })
    }

    /// How many numbers there are.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Fills `out` with the numbers from number `first` on (in C order).
    ///
    /// # Errors
    /// Numbers outside the array; a file that became shorter; what the file system says.
    pub fn read_at(&self, first: u64, out: &mut [T]) -> Result<(), Error> {
        let end = first.saturating_add(out.len() as u64);
        if end > self.len {
            return Err(Error::Range { first, end, len: self.len });
        }
        let mut at = self.data_offset + first * T::BYTES as u64;
        let mut bytes = vec![0u8; BLOCK_BYTES.min(out.len() * T::BYTES)];
        for part in out.chunks_mut(BLOCK_BYTES / T::BYTES) {
            let bytes = &mut bytes[..part.len() * T::BYTES];
            self.file.read_exact_at(bytes, at)?;
            for (value, bytes) in part.iter_mut().zip(bytes.chunks_exact(T::BYTES)) {
                *value = T::from_le(bytes);
            }
            at += bytes.len() as u64;
        }
        Ok(())
    }

    /// All numbers, in C order.
    ///
    /// # Errors
    /// As [`Self::read_at`].
    pub fn read_all(&self) -> Result<Vec<T>, Error> {
        // The file is as long as this (checked when it was opened), so it is no mere claim.
        let mut out = vec![T::default(); usize::try_from(self.len).unwrap_or(usize::MAX)];
        self.read_at(0, &mut out)?;
        Ok(out)
    }
}

/// A one-dimensional array of whole numbers of any width, as numpy happens to have saved it.
///
/// # Errors
/// Another kind of number, other than one dimension, or a number above what `i64` holds.
pub fn read_integers(path: &Path) -> Result<Vec<i64>, Error> {
    fn all<T: Value>(file: File, header: Header) -> Result<Vec<i64>, Error>
    where
        i64: TryFrom<T>,
    {
        let reader = Reader::<T>::from_header(file, header)?;
        reader.shape_of::<1>()?;
        let convert = |value| {
            i64::try_from(value).map_err(|_| broken("it holds numbers above what int64 can"))
        };
        reader.read_all()?.into_iter().map(convert).collect()
    }
    let mut file = File::open(path)?;
    let header = Header::read(&mut file)?;
    match header.descr.trim_start_matches('|') {
        "<i4" => all::<i32>(file, header),
        "<u4" => all::<u32>(file, header),
        "<i2" => all::<i16>(file, header),
        "<u2" => all::<u16>(file, header),
        "i1" => all::<i8>(file, header),
        "u1" | "b1" => {
            let descr = u8::DESCR.to_owned();
            all::<u8>(file, Header { descr, ..header })
        }
        "<u8" => all::<u64>(file, header),
        _ => all::<i64>(file, header),
    }
}

fn header_bytes<T: Value>(shape: &[usize]) -> Vec<u8> {
    let mut text = format!(
        "{{'descr': '{}', 'fortran_order': False, 'shape': {}, }}",
        T::DESCR,
        shape_text(shape)
    );
    if let Some(first) = shape.first() {
        let digits = first.to_string().len();
        text.push_str(&" ".repeat(GROWTH_DIGITS.saturating_sub(digits)));
    }
    // magic 6, version 2, length 2, newline 1
    let whole = (text.len() + 11).next_multiple_of(64);
    text.push_str(&" ".repeat(whole - 11 - text.len()));
    text.push('\n');
    let mut out = Vec::with_capacity(whole);
    out.extend_from_slice(MAGIC);
    out.extend_from_slice(&[1, 0]);
    // Shapes have at most 32 dimensions of 20 digits: this stays far below 64 KiB.
    out.extend_from_slice(&u16::try_from(whole - 10).unwrap_or(u16::MAX).to_le_bytes());
    out.extend_from_slice(text.as_bytes());
    out
}

/// Writes a whole array, sealed.
///
/// # Errors
/// `data` that doesn't fit `shape`; what the file system says.
pub fn write<T: Value>(path: &Path, shape: &[usize], data: &[T]) -> Result<(), Error> {
    let mut writer = Writer::create(path, shape)?;
    writer.push(data)?;
    writer.finish()
}

/// Writes an array piece by piece: the shape is known first, the numbers follow in C order.
/// The file appears under its name once [`Self::finish`] was called; without that nothing stays.
#[derive(Debug)]
pub struct Writer<T> {
    out: BufWriter<File>,
    path: PathBuf,
    written: u64,
    len: u64,
    scratch: Vec<u8>,
    kind: PhantomData<fn(T)>,
}

impl<T: Value> Writer<T> {
    /// Begins an array.
    ///
    /// # Errors
    /// A shape of more numbers than a file can hold; what the file system says.
    pub fn create(path: &Path, shape: &[usize]) -> Result<Self, Error> {
        let len = shape
            .iter()
            .try_fold(1u64, |n, &d| n.checked_mul(u64::try_from(d).ok()?))
            .filter(|n| n.checked_mul(T::BYTES as u64).is_some() && shape.len() <= MAX_DIMENSIONS)
            .ok_or_else(|| broken(format!("shape {} is too large", shape_text(shape))))?;
        let mut out = BufWriter::with_capacity(BLOCK_BYTES, File::create(seal::growing(path))?);
        let path = path.to_owned();
        let begun = out.write_all(&header_bytes::<T>(shape));
        let scratch = Vec::new();
        let writer = Self { out, path, written: 0, len, scratch, kind: PhantomData };
        begun?;
        Ok(writer)
    }

    /// Appends numbers.
    ///
    /// # Errors
    /// More numbers than the shape has; what the file system says.
    pub fn push(&mut self, data: &[T]) -> Result<(), Error> {
        let end = self.written + data.len() as u64;
        if end > self.len {
            return Err(Error::Range { first: self.written, end, len: self.len });
        }
        for part in data.chunks(BLOCK_BYTES / T::BYTES) {
            self.scratch.clear();
            part.iter().for_each(|value| value.put_le(&mut self.scratch));
            self.out.write_all(&self.scratch)?;
        }
        self.written = end;
        Ok(())
    }

    /// Seals the file.
    ///
    /// # Errors
    /// Fewer numbers than the shape has; what the file system says.
    pub fn finish(mut self) -> Result<(), Error> {
        if self.written != self.len {
            return Err(Error::Range { first: 0, end: self.written, len: self.len });
        }
        self.out.flush()?;
        seal::seal(self.out.get_ref(), &seal::growing(&self.path), &self.path)?;
        Ok(())
    }
}

impl<T> Drop for Writer<T> {
    fn drop(&mut self) {
        // After a seal there is nothing under this name; after an error nothing shall stay.
        let _ = fs::remove_file(seal::growing(&self.path));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Result<Header, Error> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&[1, 0]);
        bytes.extend_from_slice(&u16::try_from(text.len()).expect("short").to_le_bytes());
        bytes.extend_from_slice(text.as_bytes());
        Header::read(&mut bytes.as_slice())
    }

    #[test]
    fn headers_of_all_shapes_are_understood() {
        let shape = |text: &str| {
            header(&format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {text}, }}  \n"))
                .map(|h| h.shape)
        };
        assert_eq!(shape("()").expect("scalar"), Vec::<usize>::new());
        assert_eq!(shape("(3,)").expect("one"), [3]);
        assert_eq!(shape("(3L, 4L)").expect("python 2"), [3, 4]);
        assert_eq!(shape("(2, 3, 4)").expect("three"), [2, 3, 4]);
        for wrong in ["(-1,)", "(1 2)", "(1,", "3", "(99999999999999999999999,)", "(1.0,)"] {
            assert!(matches!(shape(wrong), Err(Error::Header { .. })), "{wrong} was taken");
        }
        let record = header("{'shape': (1,), 'fortran_order': True, 'descr': [('a', '<f4')]}");
        let record = record.expect("reads");
        assert_eq!((record.descr.as_str(), record.fortran_order), ("[('a', '<f4')]", true));
    }

    #[test]
    fn no_broken_header_panics() {
        let good = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
        for at in 0..good.len() {
            for byte in [0, b'(', b'\'', 0xc3, b'9', b'}'] {
                let mut broken = good.to_vec();
                broken[at] = byte;
                let mut bytes = MAGIC.to_vec();
                bytes.extend_from_slice(&[2, 0]);
                bytes.extend_from_slice(&u32::try_from(good.len()).expect("short").to_le_bytes());
                bytes.extend_from_slice(&broken);
                let _ = Header::read(&mut bytes.as_slice());
                assert!(Header::read(&mut &bytes[..at + 5]).is_err());
            }
        }
    }
}
