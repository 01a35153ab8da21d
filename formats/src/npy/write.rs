use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use super::header::{MAX_DIMENSIONS, header_bytes};
use super::{BLOCK_BYTES, Error, Value, shape_text};
use crate::seal;

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
            .ok_or_else(|| Error::header(format!("shape {} is too large", shape_text(shape))))?;
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
