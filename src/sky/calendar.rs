use super::Error;

const DAYS_BEFORE_MONTH: [u32; 13] = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334, 365];

fn is_leap(year: i32) -> bool {
    (year % 4 == 0 && year % 100 != 0) || year % 400 == 0
}

/// 365 or 366, by the Gregorian calendar.
pub fn days_in_year(year: i32) -> u32 {
    if is_leap(year) { 366 } else { 365 }
}

/// Day of the year (0 is 1 January) on which a month (0 is January, 12 the next) begins.
fn first_day(year: i32, month: usize) -> u32 {
    DAYS_BEFORE_MONTH[month] + u32::from(month >= 2 && is_leap(year))
}

/// Month (1 to 12) and day of the month (from 1) of a day of the year; the last day of the year
/// for days behind it.
pub fn date_of_day(year: i32, day: u32) -> (u32, u32) {
    let day = day.min(days_in_year(year) - 1);
    let mut month = 11;
    while first_day(year, month) > day {
        month -= 1;
    }
    (month as u32 + 1, day - first_day(year, month) + 1)
}

/// Reads a day of the year (`161`, 0 is 1 January) or a date (`06-11`) of `year`.
///
/// # Errors
/// [`Error::Day`] for what is neither, [`Error::Date`] for a date that the year doesn't have.
pub fn parse_day(text: &str, year: i32) -> Result<u32, Error> {
    let text = text.trim();
    let digits = |t: &str, most: usize| {
        let plain = !t.is_empty() && t.len() <= most && t.bytes().all(|b| b.is_ascii_digit());
        plain.then(|| t.parse::<u32>().ok()).flatten()
    };
    if let Some(day) = digits(text, 4) {
        return Ok(day);
    }
    let (month, day) = text
        .split_once('-')
        .and_then(|(m, d)| Some((digits(m, 2)?, digits(d, 2)?)))
        .ok_or_else(|| Error::Day(text.to_owned()))?;
    let missing = || Error::Date { year, found: text.to_owned() };
    if !(1..=12).contains(&month) || day == 0 {
        return Err(missing());
    }
    let start = first_day(year, month as usize - 1);
    let end = first_day(year, month as usize);
    if start + day > end {
        return Err(missing());
    }
    Ok(start + day - 1)
}

/// Julian date of midnight UTC at the beginning of 1 January, proleptic Gregorian.
pub(super) fn julian_date_of_year(year: i32) -> f64 {
    let before = i64::from(year) - 1;
    let days =
        365 * before + before.div_euclid(4) - before.div_euclid(100) + before.div_euclid(400);
    // 1 January of year 1 begins at 1721425.5.
    days as f64 + 1_721_425.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_days_of_the_year_are_the_same_thing() {
        assert_eq!(parse_day("01-01", 2025), Ok(0));
        assert_eq!(parse_day("06-11", 2018), Ok(161));
        assert_eq!(parse_day("06-21", 2018), Ok(171));
        assert_eq!(parse_day("12-31", 2024), Ok(365));
        assert_eq!(parse_day(" 171 ", 2024), Ok(171));
        for year in [1900, 2000, 2023, 2024] {
            for day in 0..days_in_year(year) {
                let (month, of_month) = date_of_day(year, day);
                assert_eq!(parse_day(&format!("{month:02}-{of_month:02}"), year), Ok(day));
            }
        }
    }

    #[test]
    fn what_is_no_day_is_refused() {
        for bad in ["", "-1", "6.5", "06/11", "June", "00123", "1-2-3", "٣"] {
            assert_eq!(parse_day(bad, 2025), Err(Error::Day(bad.to_owned())), "{bad}");
        }
        for bad in ["02-29", "13-01", "00-10", "04-31", "06-00"] {
            assert!(matches!(parse_day(bad, 2025), Err(Error::Date { .. })), "{bad}");
        }
        assert_eq!(parse_day("02-29", 2024), Ok(59));
    }

    #[test]
    fn julian_dates_of_the_almanac() {
        assert_eq!(julian_date_of_year(2000), 2_451_544.5);
        assert_eq!(julian_date_of_year(1910), 2_418_672.5);
        assert_eq!(julian_date_of_year(2025), 2_460_676.5);
    }
}
