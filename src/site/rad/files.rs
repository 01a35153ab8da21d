use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::base::limits;

/// What reading one more file costs at least, bytes: empty ones aren't free either.
const LEAST_BYTES: u64 = 4096;

/// The files that a scene file includes: each is read once, and how much text they come to
/// together is bounded.
#[derive(Default)]
pub(super) struct Included {
    known: HashMap<PathBuf, Rc<[u8]>>,
    expanded_bytes: u64,
}

impl Included {
    /// The bytes of a file that `from` names; the message of a fault where it can't be read.
    pub fn open(&mut self, from: &Path, name: &str) -> Result<(PathBuf, Rc<[u8]>), String> {
        let path = from.parent().unwrap_or(Path::new("")).join(name);
        let bytes = match self.known.get(&path) {
            Some(bytes) => Rc::clone(bytes),
            None => {
                let bytes: Rc<[u8]> = read(&path)
                    .map_err(|why| format!("can't read `{}`: {why}", path.display()))?
                    .into();
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

fn read(path: &Path) -> Result<Vec<u8>, String> {
    let meta = std::fs::metadata(path).map_err(|e| e.to_string())?;
    // A device has no end.
    if !meta.is_file() {
        return Err("it is no ordinary file".to_owned());
    }
    if meta.len() > limits::MAX_EXPANDED_BYTES {
        return Err(format!(
            "it has {} bytes; an included file may have {} at most",
            meta.len(),
            limits::MAX_EXPANDED_BYTES
        ));
    }
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(limits::MAX_EXPANDED_BYTES).read_to_end(&mut bytes))
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}
