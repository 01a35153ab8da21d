//! The header of an `.npy` file: a Python literal, of which only what NumPy itself writes is
//! understood, and everything else is refused with its place.

use std::io::{self, Read};

use super::{Error, Value};

/// What every `.npy` file begins with.
pub const MAGIC: &[u8; 6] = b"\x93NUMPY";
/// Dimensions that an array may have; numpy has the same limit.
pub(super) const MAX_DIMENSIONS: usize = 32;
const MAX_HEADER_BYTES: usize = 1 << 20;
/// numpy leaves room for a first axis of this many digits to grow into.
const GROWTH_DIGITS: usize = 21;

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
            return Err(Error::header(format!(
                "it claims {length} bytes, at most {MAX_HEADER_BYTES}"
            )));
        }
        let mut text = vec![0u8; bytes];
        exactly(input, &mut text)?;
        let text = String::from_utf8(text).map_err(|_| Error::header("it isn't text"))?;
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
        io::ErrorKind::UnexpectedEof => Error::header("the file ends inside it"),
        _ => Error::Io(e),
    })
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
            _ => Err(Error::header("expected the keys `descr`, `fortran_order` and `shape`")),
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
        Error::header(format!("{what} at character {}, found `{}`", self.at, found.trim_end()))
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

/// The header of an array, as numpy writes it.
pub(super) fn header_bytes<T: Value>(shape: &[usize]) -> Vec<u8> {
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
