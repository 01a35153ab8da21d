//! What lies on the disk: how much, how much is free, and how it is removed.

use std::fs;
use std::path::{Component, Path};

use glintmap_formats::seal;

use super::error::Error;

/// Free bytes for us on the disk where `path`, or the nearest folder above it, lies.
pub(super) fn free_bytes(path: &Path) -> Result<u64, Error> {
    let mut at = std::path::absolute(path)?;
    while !at.exists() && at.pop() {}
    let stat = rustix::fs::statvfs(&at).map_err(std::io::Error::from)?;
    Ok(stat.f_bavail.saturating_mul(stat.f_frsize))
}

/// Bytes of all files below a folder; 0 if there is none.
pub(super) fn used_bytes(path: &Path) -> Result<u64, Error> {
    if !path.is_dir() {
        return Ok(0);
    }
    let mut sum = 0;
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        let meta = entry.metadata()?;
        sum += if meta.is_dir() { used_bytes(&entry.path())? } else { meta.len() };
    }
    Ok(sum)
}

/// `1.5 GB`
pub fn bytes_in_words(bytes: u64) -> String {
    let value = bytes as f64;
    for (unit, size) in [("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)] {
        if value >= size {
            return format!("{:.1} {unit}", value / size);
        }
    }
    format!("{bytes} B")
}

/// The manifest is a file like any other: what it names must lie below `run/`.
pub(super) fn lies_inside(name: &Path) -> bool {
    name.components().all(|c| matches!(c, Component::Normal(_))) && name.file_name().is_some()
}

/// Removes a file, or a folder with all that is in it. A folder loses its name first, so that
/// nobody takes half of it for the whole.
///
/// # Errors
/// [`Error::Write`].
pub(super) fn remove(path: &Path) -> Result<(), Error> {
    let failed = |source| Error::Write { path: path.to_owned(), source };
    // What a removal that was killed half-way left without its name goes first, also where that is
    // all there is.
    let nameless = seal::growing(path);
    if fs::symlink_metadata(&nameless).is_ok_and(|m| m.is_dir()) {
        fs::remove_dir_all(&nameless).map_err(failed)?;
    }
    let removed = match fs::symlink_metadata(path) {
        Err(_) => Ok(()),
        Ok(m) if m.is_dir() => {
            fs::rename(path, &nameless).and_then(|()| fs::remove_dir_all(&nameless))
        }
        Ok(_) => fs::remove_file(path),
    };
    removed.map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_out_of_the_run_folder_are_not_ours() {
        for good in ["suns.csv", "standard/plan/series.zarr"] {
            assert!(lies_inside(Path::new(good)), "{good}");
        }
        for bad in ["../thesis.txt", "/etc/passwd", "a/../../b", "", "."] {
            assert!(!lies_inside(Path::new(bad)), "{bad}");
        }
    }

    #[test]
    fn a_removal_that_was_killed_is_finished_by_the_next() {
        let keep = tempfile::tempdir().expect("a folder");
        let path = keep.path().join("spill");
        let half = keep.path().join("spill.tmp");
        fs::create_dir(&half).expect("makes");
        remove(&path).expect("removes what is left");
        assert!(!half.exists());
        for folder in [&path, &half] {
            fs::create_dir(folder).expect("makes");
        }
        remove(&path).expect("removes both");
        assert!(!half.exists() && !path.exists());
    }
}
