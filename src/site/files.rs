use std::borrow::Cow;
use std::collections::BTreeMap;
use std::env;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::Error;
use crate::base::limits;

/// Where scene files are read from: the disk, or memory (programs that make scenes, tests).
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// Instead of the disk.
    memory: Option<BTreeMap<PathBuf, Vec<u8>>>,
    /// Radiance's library folders.
    library: Vec<PathBuf>,
}

impl Files {
    /// The disk. Radiance files are looked for in the folders of `RAYPATH` as well; relative ones
    /// would depend on where the program is started and are left out.
    pub fn on_disk() -> Self {
        let path = env::var_os("RAYPATH").unwrap_or_default();
        Self {
            memory: None,
            library: env::split_paths(&path).filter(|p| p.is_absolute()).collect(),
        }
    }

    /// These files alone, by path.
    pub fn in_memory<P: Into<PathBuf>>(files: impl IntoIterator<Item = (P, Vec<u8>)>) -> Self {
        let memory = files.into_iter().map(|(path, bytes)| (path.into(), bytes)).collect();
        Self { memory: Some(memory), library: Vec::new() }
    }

    /// Where a file lies that a Radiance scene names: beside the file that names it, beside the
    /// scene's first file (where `oconv` would run), then in the library's folders, unless its name
    /// begins with a dot. Where it is nowhere, where it should be.
    pub fn find(&self, from: &Path, scene: &Path, name: &str) -> PathBuf {
        let beside = |file: &Path| file.parent().unwrap_or(Path::new("")).join(name);
        let library = if name.starts_with('.') { &[][..] } else { &self.library };
        let mut places =
            [beside(from), beside(scene)].into_iter().chain(library.iter().map(|f| f.join(name)));
        places.find(|place| self.is_file(place)).unwrap_or_else(|| beside(from))
    }

    /// Whether a path is that of an ordinary file; a device has no end.
    pub fn is_file(&self, path: &Path) -> bool {
        match &self.memory {
            None => path.is_file(),
            Some(memory) => memory.contains_key(path),
        }
    }

    /// Length of a file, bytes.
    ///
    /// # Errors
    /// When it isn't there or no ordinary file.
    pub fn length(&self, path: &Path) -> io::Result<u64> {
        match &self.memory {
            Some(memory) => {
                memory.get(path).map(|b| b.len() as u64).ok_or(io::ErrorKind::NotFound.into())
            }
            None => {
                let meta = fs::metadata(path)?;
                if meta.is_dir() {
                    return Err(io::ErrorKind::IsADirectory.into());
                }
                if !meta.is_file() {
                    return Err(io::Error::other("it is no ordinary file"));
                }
                Ok(meta.len())
            }
        }
    }

    /// The bytes of a file of at most `limit` bytes.
    ///
    /// # Errors
    /// When it can't be read, or is longer.
    pub fn read(&self, path: &Path, limit: u64) -> io::Result<Cow<'_, [u8]>> {
        let length = self.length(path)?;
        if length > limit {
            let message = format!("it has {length} bytes; {limit} at most are read");
            return Err(io::Error::other(message));
        }
        if let Some(bytes) = self.memory.as_ref().and_then(|memory| memory.get(path)) {
            return Ok(Cow::Borrowed(bytes));
        }
        let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
        File::open(path)?.take(limit).read_to_end(&mut bytes)?;
        Ok(Cow::Owned(bytes))
    }

    /// The bytes of a file of the scene.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::FileTooLarge`].
    pub(super) fn scene_file(&self, path: &Path) -> Result<Cow<'_, [u8]>, Error> {
        let failed = |source| Error::Read { path: path.to_owned(), source };
        let limit = limits::MAX_TEXT_FILE_BYTES;
        let bytes = self.length(path).map_err(failed)?;
        if bytes > limit {
            return Err(Error::FileTooLarge { path: path.to_owned(), bytes, limit });
        }
        self.read(path, limit).map_err(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_beside_the_scene_and_in_the_library() {
        let mut files = Files::in_memory(
            ["a/x.rad", "a/b/y.rad", "lib/z.rad", "lib/x.rad"].map(|p| (p, Vec::new())),
        );
        files.library.push("lib".into());
        let find = |name| files.find(Path::new("a/b/inner.rad"), Path::new("a/scene.rad"), name);
        assert_eq!(find("y.rad"), Path::new("a/b/y.rad"));
        assert_eq!(find("x.rad"), Path::new("a/x.rad"));
        assert_eq!(find("z.rad"), Path::new("lib/z.rad"));
        // Names that begin with a dot are never of the library; what is nowhere is missed nearby.
        assert_eq!(find("./z.rad"), Path::new("a/b/./z.rad"));
        assert_eq!(find("none.rad"), Path::new("a/b/none.rad"));
        let long = files.read(Path::new("a/x.rad"), 0);
        assert!(long.is_ok());
        assert_eq!(files.read(Path::new("q"), 9).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
