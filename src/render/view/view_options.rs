//! Views as text: Radiance's options, view files, the headers of pictures.

use glam::DVec3;

use super::camera::{Projection, View, ViewOptions};
use super::error::Error;

/// Begins of lines that hold a view, as Radiance's `isview` knows them.
const VIEW_WORDS: [&str; 8] =
    ["VIEW=", "rpict", "rview", "rvu", "rpiece", "pinterp", "vwrays", "glintmap"];

const KNOWN: &str = "one of -vtv -vtl -vth -vta -vtc -vts -vp -vd -vu -vh -vv -vs -vl -vo -va";

struct Word<'a> {
    column: usize,
    text: &'a str,
}

fn words(options: &str) -> Vec<Word<'_>> {
    let mut out = Vec::new();
    let mut start = None;
    for (column, (at, letter)) in options.char_indices().enumerate() {
        match (letter.is_whitespace(), start) {
            (false, None) => start = Some((column, at)),
            (true, Some((first, from))) => {
                out.push(Word { column: first + 1, text: &options[from..at] });
                start = None;
            }
            _ => {}
        }
    }
    if let Some((first, from)) = start {
        out.push(Word { column: first + 1, text: &options[from..] });
    }
    out
}

/// Takes the numbers behind an option.
struct Reader<'a> {
    words: Vec<Word<'a>>,
    next: usize,
    end: usize,
}

impl Reader<'_> {
    fn number(&mut self, option: &str, what: &str) -> Result<f64, Error> {
        let expected = format!("a number ({what} of {option})");
        let Some(word) = self.words.get(self.next) else {
            let found = "the end".to_owned();
            return Err(Error::ViewWord { column: self.end, expected, found });
        };
        let value = word.text.parse::<f64>().ok().filter(|v| v.is_finite() && v.abs() < 1e12);
        let Some(value) = value else {
            let found = format!("`{}`", word.text);
            return Err(Error::ViewWord { column: word.column, expected, found });
        };
        self.next += 1;
        Ok(value)
    }

    fn vector(&mut self, option: &str) -> Result<DVec3, Error> {
        Ok(DVec3::new(
            self.number(option, "x")?,
            self.number(option, "y")?,
            self.number(option, "z")?,
        ))
    }
}

/// Applies the options in `text` over `out`; says how many there were. Words that aren't view
/// options are passed over where `lenient` (the command line that a picture's header quotes).
fn apply(text: &str, lenient: bool, out: &mut ViewOptions) -> Result<usize, Error> {
    let mut r = Reader { words: words(text), next: 0, end: text.chars().count() + 1 };
    let mut count = 0;
    while r.next < r.words.len() {
        let Word { column, text: option } = r.words[r.next];
        r.next += 1;
        count += 1;
        match option {
            "-vp" => out.point = r.vector(option)?,
            "-vd" => out.direction = r.vector(option)?,
            "-vu" => out.up = r.vector(option)?,
            "-vh" => out.horizontal = r.number(option, "the horizontal size")?,
            "-vv" => out.vertical = r.number(option, "the vertical size")?,
            "-vs" => out.shift = r.number(option, "the shift")?,
            "-vl" => out.lift = r.number(option, "the lift")?,
            "-vo" => out.fore_m = r.number(option, "the fore clipping distance")?,
            "-va" => out.aft_m = r.number(option, "the aft clipping distance")?,
            "-vtv" => out.projection = Projection::Perspective,
            "-vtl" => out.projection = Projection::Parallel,
            "-vth" => out.projection = Projection::Hemispherical,
            "-vta" => out.projection = Projection::Angular,
            "-vtc" => out.projection = Projection::Cylindrical,
            "-vts" => out.projection = Projection::Planisphere,
            _ if lenient => count -= 1,
            _ => {
                let mut found = format!("`{option}`");
                if option == "-vf" {
                    found.push_str(" (a view file is given as view_file = \"…\")");
                }
                return Err(Error::ViewWord { column, expected: KNOWN.to_owned(), found });
            }
        }
    }
    Ok(count)
}

impl View {
    /// Reads Radiance's view options: `-vtl -vp 0 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 200 -vv 200`.
    /// What is left out has Radiance's defaults (perspective from the origin to +y, 45 degrees).
    ///
    /// # Errors
    /// [`Error::ViewWord`] with the column of the word that doesn't fit, [`Error::View`] where the
    /// options together make no view.
    pub fn parse(options: &str, columns: usize, rows: usize) -> Result<Self, Error> {
        let mut found = ViewOptions::default();
        apply(options, false, &mut found)?;
        Self::from_options(found, columns, rows)
    }

    /// Reads a view file or the header of a Radiance picture: the options of all lines that begin
    /// with `VIEW=` or the name of a program that takes views, later ones over earlier ones. Of an
    /// OpenEXR picture its attribute `VIEW`, as ours have it.
    ///
    /// # Errors
    /// As [`View::parse`]; [`Error::View`] where nothing holds a view.
    pub fn from_file(bytes: &[u8], columns: usize, rows: usize) -> Result<Self, Error> {
        if bytes.starts_with(&EXR) {
            let Some(options) = exr_text(bytes, "VIEW") else {
                let what = "the picture has no attribute `VIEW`; write `view` instead";
                return Err(Error::View { what: what.to_owned() });
            };
            return Self::parse(options, columns, rows);
        }
        let text = String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 20)]);
        let picture = text.starts_with("#?");
        let mut found = ViewOptions::default();
        let mut count = 0;
        for line in text.lines() {
            if picture && line.trim().is_empty() {
                break;
            }
            let line = line.trim();
            let first = line.split_whitespace().next().unwrap_or("");
            let name = first.rsplit('/').next().unwrap_or(first);
            let Some(word) = VIEW_WORDS.iter().find(|w| name.starts_with(**w)) else { continue };
            let rest = match *word {
                "VIEW=" => line.strip_prefix("VIEW=").unwrap_or(line),
                _ => line,
            };
            count += apply(rest, true, &mut found)?;
        }
        if count == 0 {
            let what = "no line holds a view; expected one that begins with `VIEW=` or `rvu`";
            return Err(Error::View { what: what.to_owned() });
        }
        Self::from_options(found, columns, rows)
    }

    /// All options of the view, which [`View::parse`] reads back without loss.
    pub fn to_options(&self) -> String {
        let o = self.options();
        let letter = match o.projection {
            Projection::Perspective => 'v',
            Projection::Parallel => 'l',
            Projection::Hemispherical => 'h',
            Projection::Angular => 'a',
            Projection::Cylindrical => 'c',
            Projection::Planisphere => 's',
        };
        let v = |d: DVec3| format!("{} {} {}", d.x, d.y, d.z);
        format!(
            "-vt{letter} -vp {} -vd {} -vu {} -vh {} -vv {} -vo {} -va {} -vs {} -vl {}",
            v(o.point),
            v(o.direction),
            v(o.up),
            o.horizontal,
            o.vertical,
            o.fore_m,
            o.aft_m,
            o.shift,
            o.lift
        )
    }

    /// The line with which a Radiance picture's header says its view.
    pub fn to_view_line(&self) -> String {
        format!("VIEW= {}", self.to_options())
    }
}

/// How an OpenEXR file begins.
const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// A text attribute of an OpenEXR picture. Its header follows eight bytes of magic and version: of
/// each attribute the name, the type, the length and the value, then an empty name (OpenEXR,
/// "File Layout").
fn exr_text<'a>(file: &'a [u8], wanted: &str) -> Option<&'a str> {
    let word = |bytes: &'a [u8]| {
        let end = bytes.iter().position(|b| *b == 0)?;
        Some((&bytes[..end], &bytes[end + 1..]))
    };
    let mut rest = file.get(8..)?;
    loop {
        let (name, after) = word(rest)?;
        if name.is_empty() {
            return None;
        }
        let (kind, after) = word(after)?;
        let (length, after) = after.split_first_chunk::<4>()?;
        let (value, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        if name == wanted.as_bytes() && kind == b"string" {
            return std::str::from_utf8(value).ok();
        }
        rest = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(options: &str) -> String {
        View::parse(options, 10, 10).expect_err(options).to_string()
    }

    #[test]
    fn a_word_that_does_not_fit_is_named_with_its_place() {
        assert_eq!(
            fault("-vtl -vp 0 x 1"),
            "view, column 12: expected a number (y of -vp), found `x`"
        );
        assert_eq!(fault("-vp 0 0"), "view, column 8: expected a number (z of -vp), found the end");
        assert!(fault("-vtl -vq 1").starts_with("view, column 6: expected one of -vtv"));
        assert!(fault("-vtx").contains("`-vtx`"));
        assert!(fault("-vf a.vf").contains("view_file"));
        assert!(fault("-vh nan").contains("found `nan`"));
    }

    #[test]
    fn options_that_make_no_view_are_refused() {
        for (options, word) in [
            ("-vd 0 0 -1", "parallel"),
            ("-vd 0 0 0", "-vd"),
            ("-vu 0 0 0", "-vu"),
            ("-vtv -vh 180", "-vh is 180"),
            ("-vtc -vv 180", "-vv is 180"),
            ("-vth -vh 181", "up to 180"),
            ("-vta -vh 361", "up to 360"),
            ("-vts -vv 360", "below 360"),
            ("-vtl -vh 0", "metres"),
            ("-vo -1", "-vo -1"),
            ("-vo 5 -va 4", "-va 4"),
        ] {
            assert!(fault(options).contains(word), "{options}: {}", fault(options));
        }
        assert!(View::parse("", 0, 1).is_err());
        assert!(View::parse("", 70_000, 1).is_err());
        assert!(View::parse("", 10_000, 10_000).is_err());
    }

    #[test]
    fn views_survive_their_own_line_and_files_are_read() {
        let options = "-vtc -vp 1.25 -3 0.1 -vd 0 -1 0.1 -vu 0 0 1 -vh 360 -vv 75 -vo 2 -vs 0.25";
        let view = View::parse(options, 80, 20).expect("parses");
        let line = view.to_view_line();
        assert_eq!(View::from_file(line.as_bytes(), 80, 20).expect("reads"), view);
        let picture =
            format!("#?RADIANCE\nrpict -ab 2 -vp 9 9 9 x.oct\n{line}\n\n-Y 20 +X 80\nVIEW= -vh");
        assert_eq!(View::from_file(picture.as_bytes(), 80, 20).expect("reads"), view);
        let rvu = View::from_file(b"/usr/bin/rvu -vtl -vh 7 -vv 7\n", 5, 5).expect("reads");
        assert_eq!((rvu.projection(), rvu.size()), (Projection::Parallel, [7.0, 7.0]));
        assert!(View::from_file(b"nothing here\n", 5, 5).is_err());
    }

    #[test]
    fn the_view_of_an_openexr_picture_is_its_attribute() {
        let header = |attributes: &[(&str, &str, &str)]| {
            let mut out = [&EXR[..], &[2, 0, 0, 0]].concat();
            for (name, kind, value) in attributes {
                out.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat());
                out.extend((value.len() as u32).to_le_bytes());
                out.extend(value.as_bytes());
            }
            out.extend(b"\0and then the pixels: VIEW");
            out
        };
        let whole = header(&[("lines", "lineOrder", "\0"), ("VIEW", "string", "-vtl -vh 7 -vv 7")]);
        let view = View::from_file(&whole, 5, 5).expect("reads");
        assert_eq!((view.projection(), view.size()), (Projection::Parallel, [7.0, 7.0]));
        for length in 4..whole.len() - 30 {
            assert!(View::from_file(&whole[..length], 5, 5).is_err(), "{length} bytes");
        }
        for other in [("view", "string", "-vtl"), ("VIEW", "float", "-vtl")] {
            let error = View::from_file(&header(&[other]), 5, 5).expect_err("no view");
            assert!(error.to_string().contains("no attribute `VIEW`"), "{error}");
        }
    }
}
