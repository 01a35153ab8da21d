/// A number that `.npy` files of ours hold.
pub trait Value: Copy + Default {
    /// numpy's name of the type, as it stands in the header.
    const DESCR: &str;
    /// Bytes of one number.
    const BYTES: usize;
    /// The number that `bytes` (exactly [`Self::BYTES`] of them) hold.
    fn from_le(bytes: &[u8]) -> Self;
    /// Appends the number's bytes.
    fn put_le(self, out: &mut Vec<u8>);
}

macro_rules! values {
    ($($type:ty, $descr:literal, $bytes:literal;)*) => {$(
        impl Value for $type {
            const DESCR: &str = $descr;
            const BYTES: usize = $bytes;
            #[inline]
            fn from_le(bytes: &[u8]) -> Self {
                let mut own = [0u8; $bytes];
                own.copy_from_slice(bytes);
                Self::from_le_bytes(own)
            }
            #[inline]
            fn put_le(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
values! {
    f32, "<f4", 4;
    f64, "<f8", 8;
    i32, "<i4", 4;
    i64, "<i8", 8;
    u32, "<u4", 4;
    u64, "<u8", 8;
    i16, "<i2", 2;
    u16, "<u2", 2;
    i8, "|i1", 1;
    u8, "|u1", 1;
}
