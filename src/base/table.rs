//! Tables of ours (CSV, RFC 4180): a row is a type whose fields are the columns, in their order.
//!
//! The types of numbers say how they are written; serde's own way with floats has exponents that
//! spreadsheets don't read.

use std::io::{self, Write};

use serde::{Deserialize, Serialize, Serializer};

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

/// A number with `N` decimals; nothing for `None`.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub struct Fixed<const N: usize>(pub Option<f64>);

/// As [`Fixed`], but `0` for what is exactly 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct FixedOr0<const N: usize>(pub Option<f64>);

/// A number with an exponent and `N` decimals.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scientific<const N: usize>(pub f64);

/// A number as short as it can be read back, without an exponent; nothing for `None`.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub struct Shortest(pub Option<f32>);

impl<const N: usize, V: Into<Option<f64>>> From<V> for Fixed<N> {
    fn from(value: V) -> Self {
        Self(value.into())
    }
}

impl<const N: usize> Serialize for Fixed<N> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Some(value) => to.collect_str(&format_args!("{value:.N$}")),
            None => to.serialize_none(),
        }
    }
}

impl<const N: usize> Serialize for FixedOr0<N> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Some(0.0) => to.serialize_u8(0),
            other => Fixed::<N>(other).serialize(to),
        }
    }
}

impl<const N: usize> Serialize for Scientific<N> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&format_args!("{:.N$e}", self.0))
    }
}

impl Serialize for Shortest {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            Some(value) => to.collect_str(value),
            None => to.serialize_none(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default, Serialize)]
    struct Who {
        name: String,
        strength: Shortest,
    }

    #[derive(Default, Serialize)]
    struct When {
        hour: Fixed<2>,
        minutes: FixedOr0<1>,
        flux: Scientific<1>,
    }

    #[test]
    fn rows_stand_side_by_side_and_strange_names_are_quoted() {
        let mut table = Table::of::<(Who, When)>(Vec::new()).expect("writes");
        let name = "a \"tower\", old".to_owned();
        let when =
            When { hour: 0.125.into(), minutes: FixedOr0(Some(0.0)), flux: Scientific(1234.0) };
        let strength = Shortest(Some(1e-7));
        table.push((Who { name, strength }, when)).expect("writes");
        table.push((Who::default(), When::default())).expect("writes");
        let text = String::from_utf8(table.finish().expect("writes")).expect("text");
        let expected = "name,strength,hour,minutes,flux\n\
                        \"a \"\"tower\"\", old\",0.0000001,0.12,0,1.2e3\n,,,,0.0e0\n";
        assert_eq!(text, expected);
    }
}
