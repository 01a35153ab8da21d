//! One photon of a run, sent once more.

use serde::Serialize;

use super::error::Error;
use super::stages::Traced;
use crate::project::Folder;
use crate::project::Resolved;
use crate::receivers::clock::Clock;
use crate::site::Site;
use crate::sky;
use crate::trace::{Emission, Retold, Tracer};

/// One photon's path with the names of what it met.
#[derive(Clone, Debug, Serialize)]
pub struct Replayed {
    /// The material or case.
    pub material: String,
    /// Date and civil time.
    pub at: String,
    /// Altitude of its point of the sun, degrees.
    pub sun_altitude_deg: f64,
    /// Azimuth, clockwise from north, degrees.
    pub sun_azimuth_deg: f64,
    /// The PV surface's name.
    pub pv: String,
    /// What it hit: the object's name, if it hit anything.
    pub object: Option<String>,
    /// The path.
    #[serde(flatten)]
    pub path: Retold,
}

/// Sends photon `number` of a candidate's run again.
///
/// # Errors
/// When there is no such material or photon, or it wasn't traced yet.
pub fn replay(resolved: &Resolved, material: Option<&str>, number: u64) -> Result<Replayed, Error> {
    let found = match material {
        Some(name) => resolved.candidates.iter().find(|c| c.name == name),
        None => resolved.candidates.first(),
    };
    let candidate = found.ok_or_else(|| {
        let known: Vec<_> = resolved.candidates.iter().map(|c| c.name.as_str()).collect();
        resolved.mistaken(format!(
            "no material or case is named \"{}\" (there are: {})",
            material.unwrap_or_default(),
            known.join(", ")
        ))
    })?;
    let folder = Folder::new(resolved.run_folder());
    let path = folder.at(&folder.tally(&candidate.name));
    if !path.exists() {
        return Err(Error::NotMade {
            what: format!("the photons of \"{}\" weren't traced yet", candidate.name),
            project: resolved.folder.clone(),
            stage: "trace",
        });
    }
    let traced: Traced = folder.read_json(&folder.tally(&candidate.name))?;
    let timeline = sky::timeline(&resolved.place, &resolved.times)?;
    let site = Site::load(&resolved.scene, &resolved.pv)?;
    let emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect(),
        settings: resolved.trace,
    };
    let path = Tracer::new(&emission)?.replay(&traced.plan, number)?;
    let step = &timeline.steps[path.timestep];
    let [x, y, z] = path.to_sun;
    let azimuth_deg = libm::atan2(x, y).to_degrees();
    let object = path.triangle.map(|triangle| {
        let object = &site.objects[site.face_of(triangle).object as usize];
        if object.id.is_empty() { object.kind.clone() } else { object.id.clone() }
    });
    Ok(Replayed {
        material: candidate.name.clone(),
        at: Clock::new(&resolved.project.site, timeline.year).show(step.day, step.hour),
        sun_altitude_deg: libm::asin(z.clamp(-1.0, 1.0)).to_degrees(),
        sun_azimuth_deg: if azimuth_deg < 0.0 { azimuth_deg + 360.0 } else { azimuth_deg },
        pv: site.pv[usize::from(path.surface)].name.clone(),
        object,
        path,
    })
}
