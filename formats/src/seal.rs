//! Files appear whole or not at all: written beside their name, flushed, renamed, and the folder
//! flushed. What carries its final name is sealed and never changes.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::fault;

/// Where a file grows before it is sealed: the name with `.tmp` behind it.
pub fn growing(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".tmp");
    PathBuf::from(name)
}

/// Flushes `file`, gives it its final name and flushes the folder.
///
/// # Errors
/// Whatever the file system says; the file under the final name, if any, is then unchanged.
pub fn seal(file: &File, growing: &Path, path: &Path) -> io::Result<()> {
    fault::step(path);
    file.sync_all()?;
    fs::rename(growing, path)?;
    fault::step(path);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}

/// Writes a file in one go: `fill` writes into a buffer, then the file is sealed. On any error
/// nothing is left behind and what existed under the name stays.
///
/// # Errors
/// Whatever `fill` or the file system says.
pub fn write<E: From<io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    let tmp = growing(path);
    let result = (|| {
        let mut out = BufWriter::with_capacity(1 << 18, File::create(&tmp)?);
        fault::step(path);
        fill(&mut out)?;
        out.flush()?;
        seal(out.get_ref(), &tmp, path)?;
        Ok(())
    })();
    if result.is_err() {
        // The error that matters is the first one; a leftover .tmp is overwritten next time.
        let _ = fs::remove_file(&tmp);
    }
    result
}

/// [`write()`] for bytes that are already there.
///
/// # Errors
/// Whatever the file system says.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write(path, |out| out.write_all(bytes))
}
