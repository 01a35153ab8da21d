//! Amounts of memory as people write them: `512M`, `1GiB`, `1.5 GB`, `1073741824`.

/// Bytes; K, M, G and T are powers of 1,024, with or without `iB` or `B` behind them.
pub(super) fn parse(text: &str) -> Result<u64, String> {
    let expected = || format!("expected a size such as 512M or 1GiB, found `{text}`");
    let text = text.trim();
    let digits = text.find(|c: char| c != '.' && !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let number: f64 = number.parse().map_err(|_| expected())?;
    let unit = unit.trim().to_ascii_lowercase();
    let letter = unit.strip_suffix("ib").or(unit.strip_suffix('b')).unwrap_or(&unit);
    let power = ["", "k", "m", "g", "t"].iter().position(|l| *l == letter).ok_or_else(expected)?;
    let bytes = number * f64::from(1_u32 << 10).powi(i32::try_from(power).unwrap_or(0));
    // Beyond 2^63 there is no such memory.
    if bytes < 9.2e18 { Ok(bytes as u64) } else { Err(expected()) }
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn sizes_are_read_as_people_write_them() {
        for (text, bytes) in [
            ("1073741824", 1 << 30),
            ("1G", 1 << 30),
            ("1GiB", 1 << 30),
            ("1 gb", 1 << 30),
            ("0.5M", 1 << 19),
            ("3k", 3072),
            ("7B", 7),
        ] {
            assert_eq!(parse(text), Ok(bytes), "{text}");
        }
        for wrong in ["", "G", "1X", "-1M", "1.2.3M", "1e30", "9999999999999T", "1iG"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
