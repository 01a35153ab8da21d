use std::fs::File;
use std::marker::PhantomData;
use std::os::unix::fs::FileExt;
use std::path::Path;

use super::{BLOCK_BYTES, Error, Header, Value, shape_text};

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
            i64::try_from(value).map_err(|_| Error::header("it holds numbers above what int64 can"))
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
