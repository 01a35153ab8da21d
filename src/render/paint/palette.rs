use glam::Vec3;

use crate::site::{Face, Site};

/// Colour of the sun's light, relative.
pub(in crate::render) const SUN: Vec3 = Vec3::new(1.0, 0.94, 0.84);
/// What PV reflects diffusely in the picture: dark blue, so that it is found at once.
pub(in crate::render) const PV: Vec3 = Vec3::new(0.018, 0.036, 0.115);
/// Where the picture shows nothing: paper.
pub(in crate::render) const PAPER: Vec3 = Vec3::ONE;
/// Light that comes from the ground and from walls, relative to a horizontal plane in the open.
pub(in crate::render) const BOUNCE: Vec3 = Vec3::new(0.13, 0.12, 0.105);

const ZENITH: Vec3 = Vec3::new(0.26, 0.44, 0.80);
const HORIZON: Vec3 = Vec3::new(0.80, 0.87, 0.94);
const GROUND: Vec3 = Vec3::new(0.62, 0.62, 0.58);

const LEAVES: Vec3 = Vec3::new(0.13, 0.23, 0.07);
const GRASS: Vec3 = Vec3::new(0.25, 0.30, 0.15);
const ROOF: Vec3 = Vec3::new(0.40, 0.185, 0.12);
const WOOD: Vec3 = Vec3::new(0.26, 0.17, 0.10);
const WINDOW: Vec3 = Vec3::new(0.07, 0.09, 0.12);
const PLASTER: Vec3 = Vec3::new(0.68, 0.63, 0.54);
const ROAD: Vec3 = Vec3::new(0.28, 0.28, 0.29);
const WATER: Vec3 = Vec3::new(0.10, 0.20, 0.26);
const STONE: Vec3 = Vec3::new(0.42, 0.40, 0.36);

/// What parts of a scene are called, by language and data set; the first that fits counts.
const WORDS: [(&[&str], Vec3); 9] = [
    (&["window", "glass", "pane", "fenster"], WINDOW),
    (&["bark", "trunk", "timber", "wood", "holz"], WOOD),
    (&["tree", "leaf", "leaves", "foliage", "hedge", "vegetation", "crown", "baum"], LEAVES),
    (&["roof", "tile", "dach"], ROOF),
    (&["road", "street", "asphalt", "traffic", "strasse"], ROAD),
    (&["concrete", "stone", "pavement", "plaza", "beton"], STONE),
    (&["water", "river", "lake"], WATER),
    (&["wall", "facade", "plaster", "fassade"], PLASTER),
    (&["terrain", "ground", "grass", "meadow", "tinrelief", "landuse", "gelaende"], GRASS),
];

/// Colours of the scene's surfaces. Colours that the materials have are kept; a scene all in grey
/// (the paper's 25 %, city models) gets the colours that people expect of roofs, walls and trees,
/// as bright or dark as the material. This is for orientation only: no result depends on it.
#[derive(Debug)]
pub(in crate::render) struct Palette {
    faces: Vec<Paint>,
}

#[derive(Debug)]
enum Paint {
    Pv,
    Fixed(Vec3),
    /// Nothing is known but the brightness: the slope decides.
    BySlope(f32),
}

impl Palette {
    pub(in crate::render) fn of(site: &Site) -> Self {
        Self { faces: site.faces.iter().map(|face| paint(site, face)).collect() }
    }

    /// Diffuse reflectance in the picture; `None` for PV.
    pub(in crate::render) fn reflectance(&self, face: u32, normal: Vec3) -> Option<Vec3> {
        match self.faces[face as usize] {
            Paint::Pv => None,
            Paint::Fixed(colour) => Some(colour),
            Paint::BySlope(gain) if normal.z.abs() < 0.2 => Some(PLASTER * gain),
            // Between 18 and 78 degrees: hardly terrain.
            Paint::BySlope(gain) if normal.z.abs() < 0.95 => Some(ROOF.lerp(STONE, 0.35) * gain),
            Paint::BySlope(gain) => Some(STONE * gain),
        }
    }
}

fn paint(site: &Site, face: &Face) -> Paint {
    if face.pv.is_some() {
        return Paint::Pv;
    }
    let material = site.materials.get(face.material as usize);
    let own = material.map_or(Vec3::splat(0.25), |m| Vec3::from_array(m.reflectance));
    if own.max_element() - own.min_element() > 0.02 {
        return Paint::Fixed(own);
    }
    let gain = (own.y / 0.25).clamp(0.5, 1.4);
    let object = site.objects.get(face.object as usize);
    let names = [
        object.map_or("", |o| o.kind.as_str()),
        material.map_or("", |m| m.name.as_str()),
        object.map_or("", |o| o.id.as_str()),
    ];
    for name in names {
        let name = name.to_lowercase();
        for (words, colour) in WORDS {
            if words.iter().any(|w| name.contains(w)) {
                return Paint::Fixed(colour * gain);
            }
        }
    }
    Paint::BySlope(gain)
}

/// The sky's brightness in a direction, relative to display white; below the horizon, haze that
/// turns into ground.
pub(in crate::render) fn sky(direction: Vec3) -> Vec3 {
    let z = direction.z;
    if z >= 0.0 {
        let t = z.min(1.0).sqrt();
        HORIZON.lerp(ZENITH, t * (2.0 - t) * 0.9)
    } else {
        HORIZON.lerp(GROUND, (-z * 3.0).min(1.0))
    }
}
