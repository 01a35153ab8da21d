use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::base::limits;
use crate::site::Files;

/// What reading one more file costs at least, bytes: empty ones aren't free either.
const LEAST_BYTES: u64 = 4096;

/// The files that a scene file includes: each is read once, and how much text they come to
/// together is bounded.
pub(super) struct Included<'a> {
    pub files: &'a Files,
    /// The scene file, beside which names are looked for as well.
    scene: &'a Path,
    known: HashMap<PathBuf, Rc<[u8]>>,
    expanded_bytes: u64,
}

impl<'a> Included<'a> {
    pub fn new(files: &'a Files, scene: &'a Path) -> Self {
        Self { files, scene, known: HashMap::new(), expanded_bytes: 0 }
    }

    /// The bytes of a file that `from` names; the message of a fault where it can't be read.
    pub fn open(&mut self, from: &Path, name: &str) -> Result<(PathBuf, Rc<[u8]>), String> {
        let path = self.files.find(from, self.scene, name);
        let bytes = match self.known.get(&path) {
            Some(bytes) => Rc::clone(bytes),
            None => {
                let read = self.files.read(&path, limits::MAX_EXPANDED_BYTES);
                let read = read.map_err(|why| format!("can't read `{}`: {why}", path.display()))?;
                let bytes: Rc<[u8]> = read.into();
                self.known.insert(path.clone(), Rc::clone(&bytes));
                bytes
            }
        };
        self.expanded_bytes += bytes.len() as u64 + LEAST_BYTES;
        if self.expanded_bytes > limits::MAX_EXPANDED_BYTES {
            return Err(format!(
                "with its copies the scene comes to more than {} bytes of text: make fewer copies",
                limits::MAX_EXPANDED_BYTES
            ));
        }
        Ok((path, bytes))
    }
}
