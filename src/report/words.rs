//! Numbers and names as people say them.

/// `24 min`, `1 h 15 min`.
pub fn minutes(minutes: f64) -> String {
    let whole = minutes.round().max(0.0) as u64;
    match (whole / 60, whole % 60) {
        (0, m) => format!("{m} min"),
        (h, 0) => format!("{h} h"),
        (h, m) => format!("{h} h {m} min"),
    }
}

/// `17 h`, `1.5 h`; below an hour in minutes.
pub fn hours(hours: f64) -> String {
    match hours {
        h if h <= 0.0 => "0 h".into(),
        h if h < 1.0 => minutes(h * 60.0),
        h if h < 10.0 && h.fract() > 0.0 => format!("{h:.1} h"),
        h => format!("{h:.0} h"),
    }
}

/// `a`, `a and b`, `a; b and c`.
pub fn list(parts: impl IntoIterator<Item = String>) -> String {
    let all: Vec<String> = parts.into_iter().filter(|p| !p.is_empty()).collect();
    match all.split_last() {
        None => String::new(),
        Some((only, [])) => only.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join("; ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_said_as_people_say_them() {
        assert_eq!([minutes(24.0), minutes(75.0), minutes(120.0)], ["24 min", "1 h 15 min", "2 h"]);
        let said = [hours(0.0), hours(0.25), hours(7.0), hours(1.5), hours(17.2)];
        assert_eq!(said, ["0 h", "15 min", "7 h", "1.5 h", "17 h"]);
        let parts = ["a", "", "b", "c"].map(str::to_owned);
        assert_eq!(list(parts), "a; b and c");
    }
}
