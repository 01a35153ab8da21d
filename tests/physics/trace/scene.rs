//! Scenes made quad by quad, suns, and what is traced in them.

use crate::support::photons::{plan, run};
use glam::{DVec3, Vec3};
use glintmap::base::{
    Aabb, Photon, PhotonSink, Silent, SinkError, SpectralBasis, Tally, Timeline, Timestep,
};
use glintmap::bsdf::{Bsdf, Model};
use glintmap::site::{Bvh, Face, Material, Object, PvSurface, Site, Triangle};
use glintmap::trace::{Emission, Plan, Receivers, Settings};

/// A scene made quad by quad.
pub struct Scene(Site);

impl Scene {
    pub fn new() -> Self {
        let material =
            |name: &str, diffuse| Material { name: name.into(), reflectance: [0.25; 3], diffuse };
        Self(Site {
            triangles: Vec::new(),
            faces: Vec::new(),
            objects: vec![Object { id: "all".into(), kind: String::new() }],
            materials: vec![material("grey", true), material("glass", false)],
            pv: Vec::new(),
            origin: DVec3::ZERO,
            bounds: Aabb::EMPTY,
            bvh: Bvh::build(&[]),
            crowns: None,
            findings: Vec::new(),
        })
    }

    fn add(&mut self, corners: [[f32; 3]; 4], material: u32, pv: Option<u16>) {
        let [a, b, c, d] = corners.map(Vec3::from);
        let face = self.0.faces.len() as u32;
        self.0.faces.push(Face { object: 0, material, pv });
        for corners in [[a, b, c], [a, c, d]] {
            self.0.triangles.push(Triangle { corners, face });
        }
    }

    pub fn quad(mut self, corners: [[f32; 3]; 4]) -> Self {
        self.add(corners, 0, None);
        self
    }

    pub fn glass(mut self, corners: [[f32; 3]; 4]) -> Self {
        self.add(corners, 1, None);
        self
    }

    /// A rectangle of PV, its front where the corners run counter-clockwise.
    pub fn pv(mut self, corners: [[f32; 3]; 4], two_sided: bool) -> Self {
        let number = self.0.pv.len() as u16;
        let first = self.0.triangles.len() as u32;
        self.add(corners, 1, Some(number));
        let [a, b, c, _] = corners.map(|c| Vec3::from(c).as_dvec3());
        let across = (b - a).cross(c - b);
        self.0.pv.push(PvSurface {
            name: format!("pv/{number}"),
            entry: 0,
            triangles: vec![first, first + 1],
            normal: across.normalize(),
            area_m2: across.length(),
            two_sided,
        });
        self
    }

    pub fn site(mut self) -> Site {
        self.0.bounds = Aabb::around(self.0.triangles.iter().flat_map(|t| t.corners));
        self.0.bvh = Bvh::build(&self.0.triangles);
        self.0
    }
}

pub fn horizontal(x: [f32; 2], y: [f32; 2], z: f32) -> [[f32; 3]; 4] {
    [[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]]
}

/// A wall across the x axis.
pub fn wall(x: f32, y: [f32; 2], z: [f32; 2]) -> [[f32; 3]; 4] {
    [[x, y[0], z[0]], [x, y[1], z[0]], [x, y[1], z[1]], [x, y[0], z[1]]]
}

pub fn sun(azimuth_deg: f64, elevation_deg: f64) -> DVec3 {
    let (a, e) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    DVec3::new(libm::sin(a) * libm::cos(e), libm::cos(a) * libm::cos(e), libm::sin(e))
}

pub fn timeline(suns: &[(DVec3, f64)]) -> Timeline {
    let steps = suns.iter().enumerate().map(|(i, &(sun, irradiance_w_m2))| Timestep {
        day: 0,
        hour: i as f64,
        sun,
        irradiance_w_m2,
        weight_h: 1.0,
        segment: 0,
    });
    Timeline {
        steps: steps.collect(),
        step_h: 1.0,
        year: 2025,
        half_year: false,
        sun_diameter_deg: 0.533,
        basis: SpectralBasis::Broadband,
    }
}

pub fn bsdf(model: Model) -> Bsdf {
    Bsdf::from_model(&model).expect("valid")
}

#[derive(Default)]
pub struct Kept(pub Vec<Photon>);

impl PhotonSink for Kept {
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError> {
        self.0.extend_from_slice(photons);
        Ok(())
    }
}

pub fn settings(stored: u64) -> Settings {
    Settings { stored, max_path_m: 100.0, seed: 1, sun_visibility: true, receivers: Receivers::All }
}

pub fn trace(emission: &Emission) -> (Plan, Vec<Photon>, Tally) {
    let plan = plan(emission, &Silent).expect("pilot");
    let mut kept = Kept::default();
    let tally = run(emission, &plan, &mut kept, &Silent).expect("run");
    assert_eq!(tally.missing_photons(), 0);
    assert!(tally.missing_flux() < 1e-9, "{}", tally.missing_flux());
    assert_eq!(tally.sent.photons, plan.emitted);
    assert_eq!(tally.stored.photons, kept.0.len() as u64);
    assert_eq!(tally.over_bound, 0);
    let sum: f64 = kept.0.iter().map(|p| f64::from(p.flux_w)).sum();
    assert!((sum - tally.stored.flux_w).abs() <= 1e-6 * sum);
    (plan, kept.0, tally)
}
