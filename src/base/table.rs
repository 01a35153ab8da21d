//! Tables of ours (CSV, RFC 4180): a row is a type whose fields are the columns, in their order.
//!
//! The functions for `#[serde(serialize_with = "…")]` say how a number is written; serde's own way
//! with floats has exponents that spreadsheets don't read.

use std::fmt::{Display, LowerExp};
use std::io::{self, Write};

use serde::{Serialize, Serializer};

/// The names of the columns of a row.
///
/// # Errors
/// None for a row whose fields are plain values.
pub fn columns<R: Serialize + Default>() -> io::Result<Vec<String>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.serialize(R::default())?;
    let bytes = writer.into_inner().map_err(|e| io::Error::other(e.to_string()))?;
    let head = csv::Reader::from_reader(&bytes[..]).headers()?.clone();
    Ok(head.iter().map(str::to_owned).collect())
}

/// A table that grows row by row.
pub struct Table<W: Write>(csv::Writer<W>);

impl<W: Write> Table<W> {
    /// A table with these columns.
    ///
    /// # Errors
    /// Whatever `out` says.
    pub fn with_columns(out: W, columns: &[String]) -> io::Result<Self> {
        let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        writer.write_record(columns)?;
        Ok(Self(writer))
    }

    /// A table of rows of one type.
    ///
    /// # Errors
    /// Whatever `out` says.
    pub fn of<R: Serialize + Default>(out: W) -> io::Result<Self> {
        Self::with_columns(out, &columns::<R>()?)
    }

    /// Adds a row; a tuple of rows stands side by side.
    ///
    /// # Errors
    /// Whatever `out` says.
    pub fn push(&mut self, row: impl Serialize) -> io::Result<()> {
        Ok(self.0.serialize(row)?)
    }

    /// The last bytes go out.
    ///
    /// # Errors
    /// Whatever `out` says.
    pub fn finish(self) -> io::Result<W> {
        self.0.into_inner().map_err(|e| io::Error::other(e.to_string()))
    }
}

/// With `N` decimals; nothing for `None`.
pub fn fixed<const N: usize, T: Copy + Into<Option<f64>>, S: Serializer>(
    value: &T,
    to: S,
) -> Result<S::Ok, S::Error> {
    match (*value).into() {
        Some(value) => to.collect_str(&format_args!("{value:.N$}")),
        None => to.serialize_none(),
    }
}

/// As [`fixed`], but `0` for what is exactly 0.
pub fn fixed_or_0<const N: usize, S: Serializer>(
    value: &Option<f64>,
    to: S,
) -> Result<S::Ok, S::Error> {
    match value {
        Some(0.0) => to.serialize_u8(0),
        other => fixed::<N, _, _>(other, to),
    }
}

/// With an exponent and `N` decimals.
pub fn scientific<const N: usize, S: Serializer>(
    value: &impl LowerExp,
    to: S,
) -> Result<S::Ok, S::Error> {
    to.collect_str(&format_args!("{value:.N$e}"))
}

/// As short as it can be read back, without an exponent.
pub fn shortest<T: Display, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(value)
}

/// [`shortest`], nothing for `None`.
pub fn shortest_or_none<T: Display, S: Serializer>(
    value: &Option<T>,
    to: S,
) -> Result<S::Ok, S::Error> {
    match value {
        Some(value) => to.collect_str(value),
        None => to.serialize_none(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default, Serialize)]
    struct Who {
        name: String,
        #[serde(serialize_with = "shortest")]
        strength: f32,
    }

    #[derive(Default, Serialize)]
    struct When {
        #[serde(serialize_with = "fixed::<2, _, _>")]
        hour: Option<f64>,
        #[serde(serialize_with = "fixed_or_0::<1, _>")]
        minutes: Option<f64>,
        #[serde(serialize_with = "scientific::<1, _>")]
        flux: f64,
    }

    #[test]
    fn rows_stand_side_by_side_and_strange_names_are_quoted() {
        let mut table = Table::of::<(Who, When)>(Vec::new()).expect("writes");
        let name = "a \"tower\", old".to_owned();
        let when = When { hour: Some(0.125), minutes: Some(0.0), flux: 1234.0 };
        table.push((Who { name, strength: 1e-7 }, when)).expect("writes");
        table.push((Who::default(), When::default())).expect("writes");
        let text = String::from_utf8(table.finish().expect("writes")).expect("text");
        let expected = "name,strength,hour,minutes,flux\n\
                        \"a \"\"tower\"\", old\",0.0000001,0.12,0,1.2e3\n,0,,,0.0e0\n";
        assert_eq!(text, expected);
    }
}
