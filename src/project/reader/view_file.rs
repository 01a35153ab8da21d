use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::render::View;

/// Bytes of a view file or a picture's header that are looked at.
const HEAD_BYTES: u64 = 1 << 20;

/// The view of a view file or of a picture; see [`View::from_file`].
pub(super) fn read(path: &Path, columns: usize, rows: usize) -> Result<View, String> {
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head))
        .map_err(|e| e.to_string())?;
    View::from_file(&head, columns, rows).map_err(|e| e.to_string())
}
