/// `1GiB`, `256MiB`, `500MB`, `1000000`: bytes.
pub(super) fn parse_bytes(text: &str) -> Result<u64, String> {
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let factor: u64 = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kb" => 1000,
        "m" | "mb" => 1_000_000,
        "g" | "gb" => 1_000_000_000,
        "kib" => 1 << 10,
        "mib" => 1 << 20,
        "gib" => 1 << 30,
        "tb" | "t" => 1_000_000_000_000,
        "tib" => 1 << 40,
        _ => return Err(format!("expected a size such as 512MiB or 1GB, found `{text}`")),
    };
    let value: f64 = number
        .parse()
        .map_err(|_| format!("expected a size such as 512MiB or 1GB, found `{text}`"))?;
    let bytes = value * factor as f64;
    if !(1.0..=1e18).contains(&bytes) {
        return Err(format!("expected at least one byte, found `{text}`"));
    }
    Ok(bytes as u64)
}

#[cfg(test)]
mod tests {
    use super::parse_bytes;

    #[test]
    fn sizes() {
        assert_eq!(parse_bytes("1GiB"), Ok(1 << 30));
        assert_eq!(parse_bytes("1.5 MB"), Ok(1_500_000));
        assert_eq!(parse_bytes("4096"), Ok(4096));
        for wrong in ["", "MiB", "12 parsecs", "-1", "0"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }
}
