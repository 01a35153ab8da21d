//! Everything that a store promises, held against what is there.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

use super::Error;
use super::mapped::Access;
use super::page::Page;
use super::store::{OpenOptions, Store};
use crate::base::FaultKind;

/// Reads every byte of a store and checks it: all checksums, counts, that boxes and octree cells
/// hold their photons, that sums agree with the header. The findings; none for a sound store.
///
/// # Errors
/// Where the file can't be read at all, or isn't a photon store.
pub fn verify(path: &Path) -> Result<Vec<String>, Error> {
    let options = OpenOptions { cache_bytes: 0, access: Access::Pread };
    let store = match Store::open(path, &options) {
        Ok(store) => store,
        Err(e) if e.kind() == FaultKind::Damaged => return Ok(vec![e.to_string()]),
        Err(e) => return Err(e),
    };
    let checked: Vec<Checked> = (0..store.pages.len())
        .into_par_iter()
        .map(|number| match store.read(number) {
            Ok(page) => Ok(check(&store, number, &page)),
            Err(e) if e.kind() == FaultKind::Damaged => {
                Ok(Checked { findings: vec![e.to_string()], ..Checked::default() })
            }
            Err(e) => Err(e),
        })
        .collect::<Result<_, _>>()?;
    let mut flux_w = 0.0;
    let mut findings = Vec::new();
    for page in checked {
        flux_w += page.flux_w;
        findings.extend(page.findings);
    }
    let said = store.info().flux_w;
    // Each photon's flux was rounded by 1/4096 at most.
    if findings.is_empty() && (flux_w - said).abs() > said.abs() / 4096.0 {
        findings.push(format!("flux of all photons {flux_w} W, the header has {said} W"));
    }
    Ok(findings)
}

#[derive(Default)]
struct Checked {
    findings: Vec<String>,
    flux_w: f64,
}

/// What reading a page doesn't check.
fn check(store: &Store, number: usize, page: &Page) -> Checked {
    let entry = &store.pages[number];
    let mut findings = Vec::new();
    let (low, high) = store.header.layout.cube.cell_around(entry.first_cell, entry.last_cell);
    // Quantising moves a photon by half a step, and rounding by a few units of the last place.
    let bounds = page.bounds();
    let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
    let slack = bounds.size().max_element() / 65535.0 + reach * 4.0 * f32::EPSILON;
    let slack = DVec3::splat(f64::from(slack));
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    if (min + slack).cmplt(low).any() || (max - slack).cmpgt(high).any() {
        findings.push(format!(
            "page {number}: photons from {min} to {max} m outside of their octree cell, {low} to {high} m"
        ));
    }
    let (least, most) = (store.info().flux_min_w, store.info().flux_max_w);
    let slack = 1.0 / 4096.0;
    let mut flux_w = 0.0;
    for (i, light) in page.light.iter().enumerate() {
        flux_w += f64::from(light.flux_w);
        let outside = light.flux_w < least * (1.0 - slack) || light.flux_w > most * (1.0 + slack);
        if outside {
            findings.push(format!(
                "page {number}, photon {}: flux {} W, the header has {least} to {most} W",
                entry.first_photon + i as u64,
                light.flux_w
            ));
            break;
        }
    }
    Checked { findings, flux_w }
}
