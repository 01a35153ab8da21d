//! The bytes of a sealed file: mapped into memory, or read piece by piece.
//!
//! The only unsafe code of the program.

use std::borrow::Cow;
use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::fs::FileExt;

/// How the store's file is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Access {
    /// Mapped into memory: for local disks.
    #[default]
    Mapped,
    /// With `pread`: for network file systems, and wherever another program may truncate the
    /// file (then a map would kill the process, and this gives an error).
    Pread,
}

/// A sealed file of known length, locked against being rewritten by ourselves.
pub(super) struct Bytes {
    file: File,
    length: u64,
    map: Option<memmap2::Mmap>,
}

impl Bytes {
    /// Takes a file whose length was checked against its header.
    pub fn new(file: File, access: Access) -> io::Result<Self> {
        match file.try_lock_shared() {
            Err(TryLockError::WouldBlock) => {
                return Err(io::Error::other("another glintmap is writing this file"));
            }
            // Some network file systems know no locks; sealed files don't change all the same.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let length = file.metadata()?.len();
        let map = match access {
            Access::Pread => None,
            Access::Mapped if length == 0 => None,
            Access::Mapped => Some(map(&file)?),
        };
        Ok(Self { file, length, map })
    }

    /// `length` bytes from `offset`.
    ///
    /// # Errors
    /// [`io::ErrorKind::UnexpectedEof`] beyond the end.
    pub fn range(&self, offset: u64, length: usize) -> io::Result<Cow<'_, [u8]>> {
        let end = offset.checked_add(length as u64).filter(|end| *end <= self.length);
        let Some(end) = end else {
            return Err(io::ErrorKind::UnexpectedEof.into());
        };
        match &self.map {
            Some(map) => map
                .get(offset as usize..end as usize)
                .map(Cow::Borrowed)
                .ok_or_else(|| io::ErrorKind::UnexpectedEof.into()),
            None => {
                let mut bytes = vec![0; length];
                self.file.read_exact_at(&mut bytes, offset)?;
                Ok(Cow::Owned(bytes))
            }
        }
    }

    /// Says that some bytes were taken from the map and won't be looked at soon: they leave the
    /// resident memory, so that this depends on the cache alone, not on the length of the store.
    pub fn release(&self, offset: u64, length: usize) {
        let Some(map) = &self.map else { return };
        // The kernel maps what lies around a fault as well, in blocks of this size.
        let around = |byte: usize| byte & !(AROUND - 1);
        let start = around(offset as usize);
        let end = around((offset as usize).saturating_add(length + AROUND - 1)).min(map.len());
        if start < end {
            release(map, start, end - start);
        }
    }
}

/// Bytes that the kernel maps at a fault, where they are in its cache: a power of two.
const AROUND: usize = 1 << 16;

/// Takes a range out of the resident memory; a hint, so that failure is none.
#[expect(
    unsafe_code,
    reason = "the map is of a file, shared and read only: dropped pages come back as they were"
)]
fn release(map: &memmap2::Mmap, start: usize, length: usize) {
    // SAFETY: MADV_DONTNEED makes private anonymous pages zero; this map is shared and of a sealed
    // file, so that whoever looks again, in this thread or another, reads the same bytes.
    let _ =
        unsafe { map.unchecked_advise_range(memmap2::UncheckedAdvice::DontNeed, start, length) };
}

/// Maps a whole file, read only.
///
/// Contract: the file is sealed. We write under another name, flush and rename, so nobody of ours
/// changes or truncates what has this name; the shared lock, held as long as the map, keeps out a
/// glintmap that would. What remains is another program that truncates the file while it is
/// mapped: a read beyond the new end then ends the process with SIGBUS (no wrong answer, and
/// every page's checksum is checked before use). [`Access::Pread`] is for where that may happen.
#[expect(unsafe_code, reason = "a map is read only and of a sealed, locked file; see the contract")]
fn map(file: &File) -> io::Result<memmap2::Mmap> {
    // SAFETY: the contract above. The map is only handed out as `&[u8]` bound to `Bytes`.
    unsafe { memmap2::Mmap::map(file) }
}
