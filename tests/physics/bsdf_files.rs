//! Measured reflection: sampled as it is evaluated, in every basis, never more light than there was.

use std::fmt::Write as _;

use glam::DVec3;
use glintmap::base::{Purpose, Stream};
use glintmap::bsdf::{Bsdf, BsdfFile, KlemsBasis, Side, on_hemisphere};

use crate::support;

/// A file around one block of reflection.
pub fn file(structure: &str, bases: &str, numbers: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<WindowElement><Optical><Layer><Material><Name>n</Name></Material><DataDefinition><IncidentDataStructure>{structure}</IncidentDataStructure></DataDefinition><WavelengthData><Wavelength>Visible</Wavelength><WavelengthDataBlock><WavelengthDataDirection>Reflection Back</WavelengthDataDirection>{bases}<ScatteringData>{numbers}</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>"
    )
}

pub fn measured(text: &str) -> Bsdf {
    let file = BsdfFile::parse(text, "test.xml").expect("a good file");
    Bsdf::Measured(file.reflection(Side::Front, None).expect("has it"))
}

/// Klems: a lobe about the mirror direction over an uneven ground.
pub fn klems(name: &str, separator: &str) -> String {
    let basis = KlemsBasis::known(name).unwrap();
    let n = basis.len();
    let mut random = Stream::new(5, Purpose::Survey, 1);
    let mut numbers = String::new();
    for o in 0..n {
        for i in 0..n {
            let lobe = if i == o { 0.3 / basis.projected_sr(o) } else { 0.0 };
            write!(numbers, "{:.5}{separator}", 0.15 * random.uniform() + lobe).unwrap();
        }
        numbers.push('\n');
    }
    let bases =
        format!("<ColumnAngleBasis>{name}</ColumnAngleBasis><RowAngleBasis>{name}</RowAngleBasis>");
    file("Columns", &bases, &numbers)
}

/// A tree of branches down to `depth`, deeper in some places than in others.
fn tree(rank: u32, depth: u32, random: &mut Stream, out: &mut String) {
    out.push('{');
    if depth == 0 {
        write!(out, "{:.4}", 0.4 * random.uniform() * random.uniform()).unwrap();
    } else if random.uniform() < 0.3 {
        for _ in 0..1 << rank {
            write!(out, "{:.4}, ", 0.4 * random.uniform()).unwrap();
        }
    } else {
        for _ in 0..1 << rank {
            let less = 1 + u32::from(random.uniform() < 0.5);
            tree(rank, depth.saturating_sub(less), random, out);
        }
    }
    out.push('}');
}

pub fn tensor(rank: u32) -> String {
    let mut numbers = String::new();
    tree(rank, 4, &mut Stream::new(11, Purpose::Survey, u64::from(rank)), &mut numbers);
    let structure = format!("TensorTree{rank}");
    file(&structure, "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>", &numbers)
}

/// Cells of projected solid angle: rings of equal area, each cut evenly in azimuth.
const RINGS: usize = 12;
const SECTORS: usize = 24;

fn cell(d: DVec3) -> usize {
    let ring = (((1.0 - d.z * d.z) * RINGS as f64) as usize).min(RINGS - 1);
    let turns = d.y.atan2(d.x) / std::f64::consts::TAU + 0.5;
    ring * SECTORS + ((turns * SECTORS as f64) as usize).min(SECTORS - 1)
}

/// Chi-square of sampled directions against the evaluated density, and the share that survives.
fn check(name: &str, bsdf: &Bsdf, incident: DVec3) {
    const DRAWS: u64 = 100_000;
    let cells = RINGS * SECTORS;
    let mut expected = vec![0.0; cells];
    let fine = 1500_u32;
    for i in 0..fine {
        for j in 0..fine {
            let u = (f64::from(i) + 0.5) / f64::from(fine);
            let v = (f64::from(j) + 0.5) / f64::from(fine);
            let d = on_hemisphere(u, v);
            expected[cell(d)] += bsdf.evaluate(incident, d);
        }
    }
    let scale = std::f64::consts::PI / (f64::from(fine) * f64::from(fine));
    let total: f64 = expected.iter().sum::<f64>() * scale;
    let reflectance = bsdf.reflectance(incident);
    assert!((total - reflectance).abs() < 1e-2 * reflectance, "{name}: {total} {reflectance}");
    assert!(reflectance <= 1.0 + 1e-6 && bsdf.bound(incident) >= reflectance - 1e-12);
    assert!(bsdf.bound_between(incident.z - 1e-3, incident.z) >= reflectance - 1e-6, "{name}");
    let bound = 1.2 * bsdf.bound(incident);
    let mut seen = vec![0_u64; cells];
    for n in 0..DRAWS {
        let mut random = Stream::new(1, Purpose::Photon, n);
        if let Some(s) = bsdf.sample_within(incident, bound, &mut random) {
            assert!((s.direction.length() - 1.0).abs() < 1e-9 && s.direction.z >= 0.0);
            assert_eq!(s.weight, 1.0);
            seen[cell(s.direction)] += 1;
        }
    }
    let (mut chi, mut degrees) = (0.0, 0.0);
    for (&seen, e) in seen.iter().zip(&expected) {
        let e = e * scale / bound * DRAWS as f64;
        if e >= 10.0 {
            chi += (seen as f64 - e).powi(2) / e;
            degrees += 1.0;
        } else {
            assert!((seen as f64) < 40.0, "{name}: {seen} where {e} are expected");
        }
    }
    // Five standard deviations, and a little for the quadrature at the cells' borders.
    let limit = degrees + 5.0 * f64::sqrt(2.0 * degrees) + 20.0;
    assert!(chi < limit, "{name} at {incident}: chi-square {chi} of {degrees}");
}

fn incidents() -> [DVec3; 3] {
    [
        DVec3::new(0.1, 0.05, 1.0).normalize(),
        DVec3::new(-0.7, 0.5, 0.6).normalize(),
        DVec3::new(0.3, -0.95, 0.15).normalize(),
    ]
}

#[test]
fn directions_are_drawn_as_evaluated_in_every_basis() {
    let mut all: Vec<(String, Bsdf)> = Vec::new();
    for (name, separator) in
        [("LBNL/Klems Full", " "), ("LBNL/Klems Half", ",\t"), ("LBNL/Klems Quarter", ",")]
    {
        all.push((name.into(), measured(&klems(name, separator))));
    }
    for rank in [3, 4] {
        all.push((format!("rank {rank}"), measured(&tensor(rank))));
    }
    for (name, bsdf) in &all {
        for incident in incidents() {
            check(name, bsdf, incident);
        }
    }
}

#[test]
fn real_files_are_drawn_as_evaluated_on_both_sides() {
    for (name, side) in [
        ("bsdf/klems_full_2011-SA1.xml", Side::Back),
        ("bsdf/klems_full_diffuse_glass.xml", Side::Front),
        ("bsdf/klems_full_sawtooth_geometry.xml", Side::Front),
        ("bsdf/tensortree_rank3_fabric.xml", Side::Front),
    ] {
        let Some(path) = support::data(name) else { return };
        let file = BsdfFile::read(&path).expect("a good file");
        let bsdf = Bsdf::Measured(file.reflection(side, None).expect("has it"));
        for incident in incidents() {
            check(name, &bsdf, incident);
        }
    }
}

#[test]
fn a_mirror_stays_on_the_diagonal() {
    let glass = measured(&klems("LBNL/Klems Full", " "));
    for incident in incidents() {
        let mirror = DVec3::new(-incident.x, -incident.y, incident.z);
        let aside = DVec3::new(incident.y, -incident.x, incident.z);
        assert!(glass.evaluate(incident, mirror) > 2.0 * glass.evaluate(incident, aside));
    }
}

#[test]
fn more_light_than_came_in_is_scaled_down_and_said() {
    let text = file("TensorTree3", "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>", "{ 0.6 }");
    let file = BsdfFile::parse(&text, "bright.xml").unwrap();
    assert!((file.blocks[0].most_scattered - 0.6 * std::f64::consts::PI).abs() < 1e-6);
    assert!(file.notes.iter().any(|n| n.contains("scaled down")), "{:?}", file.notes);
    let bsdf = measured(&text);
    assert!((bsdf.reflectance(DVec3::Z) - 1.0).abs() < 1e-6);
}
