use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::picture::exr;
use crate::render::View;

/// Bytes of a view file or a picture's header that are looked at.
const HEAD_BYTES: u64 = 1 << 20;
/// How an OpenEXR file begins.
const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The view of a view file, of a Radiance picture (its `VIEW=` lines) or of an OpenEXR picture
/// (its attribute `VIEW`, as ours have it).
pub(super) fn read(path: &Path, columns: usize, rows: usize) -> Result<View, String> {
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head))
        .map_err(|e| e.to_string())?;
    if head.starts_with(&EXR) {
        let picture = exr::read(path).map_err(|e| e.to_string())?;
        let view = picture.attributes.iter().find(|(name, _)| name == "VIEW");
        let Some((_, options)) = view else {
            return Err("the picture has no attribute `VIEW`; write `view` instead".to_owned());
        };
        return View::parse(options, columns, rows).map_err(|e| e.to_string());
    }
    View::from_file(&head, columns, rows).map_err(|e| e.to_string())
}
