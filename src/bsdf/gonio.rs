//! Goniophotometer data as pab's instruments write them and Radiance's `pabopto2bsdf` reads them:
//! text, a header of `#` lines, then `theta phi value` of each outgoing direction. `theta` counts
//! from the normal (above 90 degrees: transmitted), `phi` around it; the light comes from
//! `#intheta`, `#inphi` (or `#incident_angle theta phi`), so that a mirror sends it to `inphi +
//! 180`. `#format: theta phi BSDF` has values in 1/sr, `DSF` the same times the outgoing cosine.
//! `#colorimetry: CIE-XYZ` has three values, of which Y is taken. `#upphi` is the azimuth of up.

use std::path::Path;

use glam::DVec3;

use super::{Error, on_circle};

/// Bytes of a file.
const MOST_BYTES: u64 = 512 << 20;
/// Outgoing directions of all incident ones.
const MOST_POINTS: usize = 20_000_000;
/// Incident directions.
const MOST_INCIDENT: usize = 4096;
/// Largest value, 1/sr.
const MOST_VALUE: f64 = 1e9;

/// Light from one direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Incident {
    /// From the normal, degrees.
    pub theta_deg: f64,
    /// Azimuth that the light comes from, degrees, with up at 90.
    pub phi_deg: f64,
    /// Direction and value, 1/sr.
    pub points: Vec<(DVec3, f32)>,
}

/// Measured reflection as scattered points.
#[derive(Clone, Debug, PartialEq)]
pub struct Goniophotometer {
    /// The sample.
    pub name: String,
    /// By polar angle, then azimuth.
    pub incidents: Vec<Incident>,
    /// What was left out or looks wrong.
    pub notes: Vec<String>,
}

/// What a header says so far.
#[derive(Clone, Default)]
struct Header {
    theta_deg: Option<f64>,
    phi_deg: Option<f64>,
    up_deg: f64,
    is_dsf: Option<bool>,
    /// Number of values, and which of them is taken.
    columns: Option<(usize, usize)>,
}

struct Reader<'a> {
    path: &'a str,
    header: Header,
    /// Whether the last line was data: a header line then begins another incidence.
    in_data: bool,
    points: usize,
    below: usize,
    negative: usize,
}

fn unit(theta_deg: f64, phi_deg: f64) -> DVec3 {
    let theta = theta_deg.to_radians();
    let turns = (phi_deg / 360.0).rem_euclid(1.0);
    let (cos, sin) = on_circle(turns);
    let radius = libm::sin(theta);
    DVec3::new(radius * cos, radius * sin, libm::cos(theta))
}

impl Goniophotometer {
    /// Reads files, which belong to one sample.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::File`].
    pub fn read(paths: &[impl AsRef<Path>]) -> Result<Self, Error> {
        let mut all = Self { name: String::new(), incidents: Vec::new(), notes: Vec::new() };
        for path in paths {
            let path = path.as_ref();
            let name = path.display().to_string();
            let failed = |reason: String| Error::Read { path: name.clone(), reason };
            let length = std::fs::metadata(path).map_err(|e| failed(e.to_string()))?.len();
            if length > MOST_BYTES {
                return Err(failed(format!("{length} bytes; at most {MOST_BYTES} are read")));
            }
            let bytes = std::fs::read(path).map_err(|e| failed(e.to_string()))?;
            all.add(&String::from_utf8_lossy(&bytes), &name)?;
        }
        all.finish(paths.first().map_or(String::new(), |p| p.as_ref().display().to_string()))
    }

    /// Reads one file's text; `path` is for messages.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn parse(text: &str, path: &str) -> Result<Self, Error> {
        let mut all = Self { name: String::new(), incidents: Vec::new(), notes: Vec::new() };
        all.add(text, path)?;
        all.finish(path.to_owned())
    }

    /// Whether a text looks like one.
    pub fn is_one(text: &str) -> bool {
        text.trim_start_matches('\u{feff}').starts_with('#')
            && text.lines().take_while(|l| l.starts_with('#')).any(|l| l.contains("theta"))
    }

    fn add(&mut self, text: &str, path: &str) -> Result<(), Error> {
        let mut reader = Reader {
            path,
            header: Header::default(),
            in_data: false,
            points: self.incidents.iter().map(|i| i.points.len()).sum(),
            below: 0,
            negative: 0,
        };
        for (at, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            reader.line(self, at + 1, line.trim())?;
        }
        if reader.below > 0 {
            self.notes
                .push(format!("{path}: {} transmitted directions were skipped", reader.below));
        }
        if reader.negative > 0 {
            self.notes.push(format!("{path}: {} negative values were taken as 0", reader.negative));
        }
        Ok(())
    }

    fn finish(mut self, path: String) -> Result<Self, Error> {
        self.incidents.retain(|i| !i.points.is_empty());
        self.incidents.sort_by(|a, b| {
            a.theta_deg.total_cmp(&b.theta_deg).then(a.phi_deg.total_cmp(&b.phi_deg))
        });
        if self.incidents.is_empty() {
            return Err(Error::File {
                path,
                line: 1,
                item: "data".into(),
                expected: "`#intheta`, `#inphi`, `#format: theta phi BSDF`, then lines of theta, phi and value".into(),
                found: "no reflected direction".into(),
            });
        }
        for i in &self.incidents {
            if i.points.len() < 12 {
                self.notes.push(format!(
                    "incidence {}°: only {} directions",
                    i.theta_deg,
                    i.points.len()
                ));
            }
        }
        Ok(self)
    }

    /// Whether all light came in one plane (azimuth): the sample counts as isotropic.
    pub fn is_isotropic(&self) -> bool {
        let mut slanting = self.incidents.iter().filter(|i| i.theta_deg > 0.01);
        let Some(first) = slanting.next() else { return true };
        slanting
            .all(|i| ((i.phi_deg - first.phi_deg + 180.0).rem_euclid(360.0) - 180.0).abs() < 0.1)
    }
}

impl Reader<'_> {
    fn wrong(&self, line: usize, item: &str, expected: &str, found: &str) -> Error {
        Error::File {
            path: self.path.to_owned(),
            line: u32::try_from(line).unwrap_or(u32::MAX),
            item: item.into(),
            expected: expected.into(),
            found: format!("`{}`", found.chars().take(40).collect::<String>()),
        }
    }

    fn line(&mut self, all: &mut Goniophotometer, at: usize, line: &str) -> Result<(), Error> {
        if line.is_empty() {
            return Ok(());
        }
        if let Some(header) = line.strip_prefix('#') {
            if self.in_data {
                // What isn't said again stays.
                (self.header.theta_deg, self.header.phi_deg) = (None, None);
                self.in_data = false;
            }
            return self.header(all, at, header.trim());
        }
        if !self.in_data {
            self.begin(all, at, line)?;
        }
        self.point(all, at, line)
    }

    fn header(&mut self, all: &mut Goniophotometer, at: usize, line: &str) -> Result<(), Error> {
        let (key, value) =
            line.split_once(|c: char| c.is_whitespace() || c == ':').unwrap_or((line, ""));
        let value = value.trim_start_matches(|c: char| c.is_whitespace() || c == ':').trim();
        let number = |text: &str, low: f64, high: f64| {
            text.parse::<f64>()
                .ok()
                .filter(|v| (low..=high).contains(v))
                .ok_or_else(|| self.wrong(at, key, &format!("degrees from {low} to {high}"), text))
        };
        match key {
            "sample_name" => all.name = value.trim_matches('"').to_owned(),
            "intheta" => self.header.theta_deg = Some(number(value, 0.0, 90.0)?),
            "inphi" => self.header.phi_deg = Some(number(value, -720.0, 720.0)?),
            "upphi" => self.header.up_deg = number(value, -720.0, 720.0)?,
            "incident_angle" => {
                let (theta, phi) = value.split_once(char::is_whitespace).unwrap_or((value, ""));
                let (theta, phi) = (number(theta, 0.0, 90.0)?, number(phi.trim(), -720.0, 720.0)?);
                (self.header.theta_deg, self.header.phi_deg) = (Some(theta), Some(phi));
            }
            "format" => {
                let words: Vec<&str> = value.split_whitespace().collect();
                let kind = words.get(2).map(|w| w.to_ascii_uppercase());
                self.header.is_dsf = match (words.first(), words.get(1), kind.as_deref()) {
                    (Some(&"theta"), Some(&"phi"), Some("DSF")) => Some(true),
                    (Some(&"theta"), Some(&"phi"), Some("BSDF" | "BRDF" | "BTDF")) => Some(false),
                    _ => {
                        let expected = "`theta phi` and BSDF, BRDF, BTDF or DSF";
                        return Err(self.wrong(at, key, expected, value));
                    }
                };
            }
            "colorimetry" => {
                self.header.columns = match value.to_ascii_uppercase().as_str() {
                    "CIE-XYZ" => Some((3, 1)),
                    "CIE-Y" => Some((1, 0)),
                    _ => return Err(self.wrong(at, key, "CIE-Y or CIE-XYZ", value)),
                };
            }
            // Dates, instruments, remarks.
            _ => {}
        }
        Ok(())
    }

    /// The first line of data after a header.
    fn begin(&mut self, all: &mut Goniophotometer, at: usize, line: &str) -> Result<(), Error> {
        let h = &self.header;
        let (Some(theta_deg), Some(phi_deg)) = (h.theta_deg, h.phi_deg) else {
            return Err(self.wrong(at, "header", "`#intheta` and `#inphi` before the data", line));
        };
        if h.is_dsf.is_none() {
            let expected = "`#format: theta phi BSDF` (or DSF) before the data";
            return Err(self.wrong(at, "header", expected, line));
        }
        let phi_deg = (phi_deg + 90.0 - h.up_deg).rem_euclid(360.0);
        let same = |i: &Incident| i.theta_deg == theta_deg && i.phi_deg == phi_deg;
        // Several files may hold parts of one incidence.
        let known = all.incidents.iter().position(same);
        if let Some(known) = known {
            let again = all.incidents.remove(known);
            all.incidents.push(again);
        } else if all.incidents.len() == MOST_INCIDENT {
            let expected = format!("at most {MOST_INCIDENT} incident directions");
            return Err(self.wrong(at, "data", &expected, line));
        } else {
            all.incidents.push(Incident { theta_deg, phi_deg, points: Vec::new() });
        }
        self.in_data = true;
        Ok(())
    }

    fn point(&mut self, all: &mut Goniophotometer, at: usize, line: &str) -> Result<(), Error> {
        let (count, taken) = self.header.columns.unwrap_or((1, 0));
        let mut numbers = [0.0_f64; 5];
        let mut words =
            line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
        let expected = || format!("theta, phi and {count} value(s), all numbers");
        for n in &mut numbers[..2 + count] {
            *n = words
                .next()
                .and_then(|w| w.parse().ok())
                .filter(|v: &f64| v.is_finite())
                .ok_or_else(|| self.wrong(at, "data", &expected(), line))?;
        }
        let [theta_deg, phi_deg, ..] = numbers;
        let value = numbers[2 + taken];
        if words.next().is_some() || !(0.0..=180.0).contains(&theta_deg) || phi_deg.abs() > 720.0 {
            let expected = format!("{}, theta from 0 to 180, phi up to 720", expected());
            return Err(self.wrong(at, "data", &expected, line));
        }
        let out = unit(theta_deg, phi_deg + 90.0 - self.header.up_deg);
        // At grazing angles nothing can be said: DSF is 0 there, whatever the BSDF.
        if out.z < 1e-3 {
            self.below += 1;
            return Ok(());
        }
        let value = if self.header.is_dsf == Some(true) { value / out.z } else { value };
        if value > MOST_VALUE {
            let expected = format!("values up to {MOST_VALUE:e} 1/sr");
            return Err(self.wrong(at, "data", &expected, line));
        }
        self.points += 1;
        if self.points > MOST_POINTS {
            let expected = format!("at most {MOST_POINTS} directions");
            return Err(self.wrong(at, "data", &expected, line));
        }
        self.negative += usize::from(value < 0.0);
        if let Some(incident) = all.incidents.last_mut() {
            incident.points.push((out, value.max(0.0) as f32));
        }
        Ok(())
    }
}
