//! What a person may name where scattering is asked for: a BSDF file, a preset, goniophotometer
//! data.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{
    Bsdf, BsdfFile, Error, Fineness, Goniophotometer, Interpolation, PRESETS, Preset, Side, Table,
    Written, write, write_points,
};

/// One of them.
pub enum Source {
    /// A BSDF file.
    File(BsdfFile),
    /// A preset, ready to scatter.
    Preset(Preset, Bsdf),
    /// Goniophotometer data, and the surface through them.
    Points(Goniophotometer, Interpolation),
}

/// Bytes that tell what a file is.
const HEAD: usize = 64 << 10;

fn is_points(path: &Path) -> Result<bool, Error> {
    use std::io::Read;
    let failed =
        |e: std::io::Error| Error::Read { path: path.display().to_string(), reason: e.to_string() };
    let mut head = Vec::with_capacity(HEAD);
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(HEAD as u64).read_to_end(&mut head).map_err(failed)?;
    Ok(Goniophotometer::is_one(&String::from_utf8_lossy(&head)))
}

impl Source {
    /// Opens what was named; all goniophotometer files together are one source.
    ///
    /// # Errors
    /// [`Error::Unknown`] for what is neither a file nor a preset, and all that readers say.
    pub fn open(names: &[PathBuf]) -> Result<Vec<Self>, Error> {
        let mut out = Vec::new();
        let mut points: Vec<&Path> = Vec::new();
        for path in names {
            if !path.exists() {
                let name = path.to_string_lossy();
                let preset = Preset::named(&name).ok_or_else(|| Error::Unknown {
                    found: name.into_owned(),
                    known: PRESETS.map(|p| p.name).join(", "),
                })?;
                out.push(Self::Preset(preset, Bsdf::from_model(&preset.model())?));
            } else if is_points(path)? {
                points.push(path);
            } else {
                out.push(Self::File(BsdfFile::read(path)?));
            }
        }
        if !points.is_empty() {
            let data = Goniophotometer::read(&points)?;
            let surface = Interpolation::of(&data);
            out.push(Self::Points(data, surface));
        }
        Ok(out)
    }

    /// What plots call it.
    pub fn name(&self) -> String {
        match self {
            Self::File(file) => Path::new(&file.path)
                .file_name()
                .map_or_else(|| file.path.clone(), |n| n.to_string_lossy().into_owned()),
            Self::Preset(preset, _) => preset.name.to_owned(),
            Self::Points(data, _) if data.name.is_empty() => "measured points".to_owned(),
            Self::Points(data, _) => data.name.clone(),
        }
    }

    /// The scattering function in the plane of incidence, 1/sr: light comes from the left at
    /// `polar_deg`; for each outgoing angle. Delta lobes are left out.
    ///
    /// # Errors
    /// A file without this side.
    pub fn in_plane(
        &self,
        side: Side,
        polar_deg: f64,
        out_deg: impl Iterator<Item = f64>,
    ) -> Result<Vec<(f64, f64)>, Error> {
        let direction = |deg: f64| {
            let angle = deg.to_radians();
            DVec3::new(libm::sin(angle), 0.0, libm::cos(angle))
        };
        let from = direction(-polar_deg);
        let measured;
        let bsdf = match self {
            Self::File(file) => {
                measured = Bsdf::Measured(file.reflection(side, None)?);
                Some(&measured)
            }
            Self::Preset(_, bsdf) => Some(bsdf),
            Self::Points(..) => None,
        };
        Ok(out_deg
            .map(|out| {
                let value = match (bsdf, self) {
                    (Some(bsdf), _) => bsdf.evaluate(from, direction(out)),
                    (None, Self::Points(_, surface)) => surface.value(from, direction(out)),
                    (None, _) => 0.0,
                };
                (out, value)
            })
            .collect())
    }

    /// Whether a tensor tree of rank 3 holds it.
    ///
    /// # Errors
    /// A file without this side.
    pub fn is_isotropic(&self, side: Side) -> Result<bool, Error> {
        Ok(match self {
            Self::File(file) => match file.reflection(side, None)?.table() {
                Table::Tree(t) => t.rank() == 3,
                Table::Matrix(_) => false,
            },
            Self::Preset(..) => true,
            Self::Points(data, _) => data.is_isotropic(),
        })
    }

    /// As a tensor tree.
    ///
    /// # Errors
    /// A file without this side, a fineness that needs too much memory.
    pub fn write(&self, side: Side, fineness: Fineness) -> Result<Written, Error> {
        match self {
            Self::File(file) => {
                let bsdf = Bsdf::Measured(file.reflection(side, None)?);
                write(&bsdf, &self.name(), fineness)
            }
            Self::Preset(preset, bsdf) => write(bsdf, preset.name, fineness),
            Self::Points(data, _) => write_points(data, fineness),
        }
    }
}
