use glam::DVec3;
use gltf::accessor::{Accessor, DataType, Dimensions, sparse::IndexType};
use gltf::buffer::View;

use crate::base::limits;

/// The bytes of a glTF file's buffers; every number on the way to an item is a claim.
pub(super) struct Buffers(pub Vec<Vec<u8>>);

impl Buffers {
    /// `count` items of `size` bytes in a view, from `offset` on, one after another.
    fn plain(
        &self,
        view: &View<'_>,
        offset: usize,
        count: usize,
        size: usize,
    ) -> Option<impl Iterator<Item = &[u8]>> {
        let stride = view.stride().unwrap_or(size).max(size);
        let length = count.checked_sub(1)?.checked_mul(stride)?.checked_add(size)?;
        let inside = offset.checked_add(length)? <= view.length();
        let start = view.offset().checked_add(offset)?;
        let bytes = self.0.get(view.buffer().index())?.get(start..start.checked_add(length)?)?;
        inside.then(|| bytes.chunks(stride).map(move |item| &item[..size]))
    }

    /// The bytes of all items of an accessor, `size` each; the replaced ones of a sparse one in
    /// their place.
    fn items(&self, accessor: &Accessor<'_>, size: usize) -> Result<Vec<u8>, String> {
        let (index, count) = (accessor.index(), accessor.count());
        let outside = || format!("accessor {index}: its {count} items lie outside its buffer");
        let held: usize = self.0.iter().map(Vec::len).sum();
        if count > held.min(3 * limits::MAX_TRIANGLES) {
            return Err(format!("accessor {index} claims {count} items"));
        }
        let mut out = Vec::new();
        match accessor.view() {
            Some(view) if count > 0 => {
                out.reserve(count * size);
                let items = self.plain(&view, accessor.offset(), count, size);
                items.ok_or_else(outside)?.for_each(|item| out.extend_from_slice(item));
            }
            None if accessor.sparse().is_none() && count > 0 => {
                return Err(format!("accessor {index} names no bytes"));
            }
            _ => out.resize(count * size, 0),
        }
        let Some(sparse) = accessor.sparse() else { return Ok(out) };
        let (wide, n) = match sparse.indices().index_type() {
            IndexType::U8 => (1, sparse.count()),
            IndexType::U16 => (2, sparse.count()),
            IndexType::U32 => (4, sparse.count()),
        };
        if n == 0 {
            return Ok(out);
        }
        let (places, values) = (sparse.indices(), sparse.values());
        let views = (places.view(), values.view());
        let places = self.plain(&views.0, places.offset(), n, wide).ok_or_else(outside)?;
        let values = self.plain(&views.1, values.offset(), n, size).ok_or_else(outside)?;
        for (place, value) in places.zip(values) {
            let at = unsigned(place) as usize;
            let target = at.checked_mul(size).and_then(|from| out.get_mut(from..from + size));
            let wrong = || format!("accessor {index}: its sparse values name item {at} of {count}");
            target.ok_or_else(wrong)?.copy_from_slice(value);
        }
        Ok(out)
    }

    /// Positions: three 32-bit floats, or whole numbers (KHR_mesh_quantization).
    pub fn positions(&self, accessor: &Accessor<'_>) -> Result<Vec<DVec3>, String> {
        let kind = accessor.data_type();
        let (wide, largest) = match kind {
            DataType::F32 => (4, 1.0),
            DataType::I8 => (1, 127.0),
            DataType::U8 => (1, 255.0),
            DataType::I16 => (2, 32767.0),
            DataType::U16 => (2, 65535.0),
            DataType::U32 => (0, 1.0),
        };
        let index = accessor.index();
        if wide == 0 || accessor.dimensions() != Dimensions::Vec3 {
            return Err(format!(
                "accessor {index}: positions are three floats or whole numbers of 8 or 16 bits, found {:?} of {kind:?}",
                accessor.dimensions()
            ));
        }
        let value = |b: &[u8]| {
            let whole = match kind {
                DataType::F32 => return f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
                DataType::I8 => f64::from(i8::from_le_bytes([b[0]])),
                DataType::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
                _ => f64::from(unsigned(b)),
            };
            if accessor.normalized() { (whole / largest).max(-1.0) } else { whole }
        };
        let bytes = self.items(accessor, 3 * wide)?;
        let points = bytes.chunks_exact(3 * wide).map(|item| {
            DVec3::new(value(&item[..wide]), value(&item[wide..2 * wide]), value(&item[2 * wide..]))
        });
        Ok(points.collect())
    }

    /// Indices below `vertices`.
    pub fn indices(&self, accessor: &Accessor<'_>, vertices: usize) -> Result<Vec<u32>, String> {
        let index = accessor.index();
        let wide = match accessor.data_type() {
            DataType::U8 => 1,
            DataType::U16 => 2,
            DataType::U32 => 4,
            other => {
                return Err(format!("accessor {index}: indices are unsigned, found {other:?}"));
            }
        };
        let bytes = self.items(accessor, wide)?;
        let out: Vec<u32> = bytes.chunks_exact(wide).map(unsigned).collect();
        match out.iter().find(|&&i| i as usize >= vertices) {
            Some(i) => Err(format!("accessor {index}: index {i} of {vertices} vertices")),
            None => Ok(out),
        }
    }
}

fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |n, &b| n << 8 | u32::from(b))
}
