use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Mutex;

use glam::{DVec3, Vec3};

use super::scene::{Direct, DirectScene, DirectScratch};
use super::series::{DirectSinks, TileYear, direct_series};
use super::sight::PvSight;
use super::year::DirectYear;
use crate::base::Irradiance;
use crate::base::{
    Frame, SeriesEntry, Silent, SinkError, SpectralBasis, TileRect, TileSink, Timeline, Timestep,
};
use crate::bsdf::{Bsdf, BsdfFile, Model, Side};
use crate::render::view::hits::{Hit, HitKind, HitMap};
use crate::site::{Crowns, Face, Material, Object, PvSurface, Season, Site, Triangle};

/// Quads, the first of them PV.
fn site(quads: &[[DVec3; 4]]) -> Site {
    let mut triangles = Vec::new();
    let mut faces = Vec::new();
    for (i, corners) in quads.iter().enumerate() {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            let corners = [corners[a], corners[b], corners[c]].map(DVec3::as_vec3);
            triangles.push(Triangle { corners, face: i as u32 });
        }
        faces.push(Face { object: 0, material: 0, pv: (i == 0).then_some(0) });
    }
    let [a, b, _, d] = quads[0];
    let across = (b - a).cross(d - a);
    let pv = PvSurface {
        name: "pv".into(),
        entry: 0,
        triangles: vec![0, 1],
        normal: across.normalize(),
        area_m2: across.length(),
        two_sided: false,
    };
    Site::from_parts(
        triangles,
        faces,
        vec![Object { id: String::new(), kind: String::new() }],
        vec![Material { name: "m".into(), reflectance: [0.2; 3], diffuse: true }],
        vec![pv],
        DVec3::ZERO,
        Vec::new(),
    )
}

/// A horizontal quad of half edge `half_m` around the origin, looking up.
fn flat(half_m: f64) -> [DVec3; 4] {
    let h = half_m;
    [[-h, -h], [h, -h], [h, h], [-h, h]].map(|[x, y]| DVec3::new(x, y, 0.0))
}

const STRENGTH: f64 = 800.0;

fn timeline(suns: &[DVec3], diameter_deg: f64) -> Timeline {
    let step = |(i, sun): (usize, &DVec3)| Timestep {
        day: 0,
        hour: i as f64 * 0.01,
        sun: sun.normalize(),
        irradiance_w_m2: STRENGTH,
        weight_h: 2.0,
        segment: 0,
    };
    Timeline {
        steps: suns.iter().enumerate().map(step).collect(),
        step_h: 0.01,
        year: 2025,
        half_year: false,
        sun_diameter_deg: diameter_deg,
        basis: SpectralBasis::Broadband,
    }
}

fn model(model: &Model) -> Bsdf {
    Bsdf::from_model(model).expect("valid")
}

fn year(site: &Site, timeline: &Timeline, bsdf: &Bsdf, at: DVec3, normal: DVec3) -> DirectYear {
    let scene =
        DirectScene { site, timeline, bsdfs: vec![bsdf], max_path_m: 1000.0, sun_visibility: true };
    let sight = PvSight::new(site, timeline, true, &Silent).expect("looks");
    let direct = Direct::new(scene, &sight).expect("fits");
    let mut out = DirectYear::default();
    direct.year(at, normal, &mut DirectScratch::default(), &mut out);
    out
}

#[test]
fn a_lambertian_square_is_its_view_factor() {
    let site = site(&[flat(3.0)]);
    let suns = [DVec3::new(0.3, 0.2, 1.0), DVec3::new(-1.0, 0.5, 0.2)];
    let timeline = timeline(&suns, 0.533);
    let bsdf = model(&Model::Lambertian { reflectance: 0.4 });
    for height in [0.5, 2.0, 10.0, 60.0] {
        // Element parallel to a rectangle with a corner above it (Howell, C-11), four times.
        let (a, root) = (3.0 / height, libm::sqrt(1.0 + 9.0 / (height * height)));
        let factor = 4.0 / (2.0 * PI) * 2.0 * (a / root) * libm::atan(a / root);
        let year = year(&site, &timeline, &bsdf, DVec3::Z * height, DVec3::NEG_Z);
        for (i, sun) in suns.iter().enumerate() {
            let expected = 0.4 * STRENGTH * sun.normalize().z * factor;
            let found = year.surface_w_m2[i];
            let miss = found / expected - 1.0;
            println!("height {height}: {found} W/m2, {miss:.1e}");
            assert!(miss.abs() < 1e-3, "{found} {expected}");
            assert!((found - expected).abs() < year.error_w_m2[i] + 1e-3 * 0.8 * expected);
        }
    }
}

#[test]
fn a_mirror_shows_the_part_of_the_disc_that_falls_into_it() {
    let site = site(&[flat(2.0)]);
    let height = 20.0;
    let radius = 0.5 * 0.533_f64.to_radians();
    // Seen from the mirror image 20 m below, the edge x = 2 lies at this angle.
    let edge = libm::atan(2.0 / height);
    let offsets = [-3.0, -1.0, -0.5, 0.0, 0.3, 0.9, 1.1];
    let suns = offsets.map(|k: f64| {
        let a = edge + k * radius;
        DVec3::new(libm::sin(a), 0.0, libm::cos(a))
    });
    let timeline = timeline(&suns, 0.533);
    let index = 1.52;
    let at = DVec3::Z * height;
    let year = year(&site, &timeline, &model(&Model::Glass { index }), at, DVec3::NEG_Z);
    for (i, k) in offsets.into_iter().enumerate() {
        // Part of a circle on one side of a chord.
        let t = k.clamp(-1.0, 1.0);
        let share = (libm::acos(t) - t * libm::sqrt(1.0 - t * t)) / PI;
        let z = suns[i].z;
        let expected = STRENGTH * crate::bsdf::fresnel_reflectance(z, index) * share * z;
        let found = year.surface_w_m2[i];
        println!("{k}: {found} {expected}");
        assert!((found - expected).abs() < 1e-3 * STRENGTH * 0.05 * share.max(0.01), "{k}");
        assert!((found == 0.0) == (k > 1.0));
    }
}

/// However little of the sun's disc stands in the mirror: behind a screen nothing arrives.
#[test]
fn slivers_of_the_disc_are_hidden_as_the_rest_is() {
    let screen = flat(50.0).map(|c| c + DVec3::Z * 10.0);
    let at = DVec3::Z * 20.0;
    let (edge, radius) = (libm::atan(2.0 / 20.0), 0.5 * 0.533_f64.to_radians());
    let suns: Vec<DVec3> = (0..200)
        .map(|i| {
            let a = edge + (1.0 - libm::pow(10.0, -4.0 * f64::from(i) / 200.0)) * radius;
            DVec3::new(libm::sin(a), 0.1 * libm::sin(a), libm::cos(a))
        })
        .collect();
    let bsdf = model(&Model::Mirror { reflectance: 1.0 });
    let of = |quads: &[[DVec3; 4]]| {
        let timeline = timeline(&suns, 0.533);
        year(&site(quads), &timeline, &bsdf, at, DVec3::NEG_Z).surface_w_m2
    };
    let (open, hidden) = (of(&[flat(2.0)]), of(&[flat(2.0), screen]));
    let faintest = open.iter().copied().filter(|w| *w > 0.0).fold(f64::INFINITY, f64::min);
    println!("down to {faintest} W/m2");
    assert!(faintest < 1e-3 * STRENGTH);
    assert!(hidden.iter().all(|w| *w == 0.0), "{hidden:?}");
}

/// The slow twin: midpoints of a fine grid, and of the disc where there is one.
fn brute(bsdf: &Bsdf, half_m: f64, n: usize, at: DVec3, normal: DVec3, suns: &[DVec3]) -> f64 {
    let step = 2.0 * half_m / n as f64;
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let x = (i as f64 + 0.5) * step - half_m;
            let y = (j as f64 + 0.5) * step - half_m;
            let way = at - DVec3::new(x, y, 0.0);
            let out = way.normalize();
            let solid = step * step * out.z / way.length_squared();
            let cos = -normal.dot(out);
            for sun in suns {
                let sun = sun.normalize();
                sum += bsdf.evaluate(sun, out) * sun.z * solid * cos.max(0.0);
            }
        }
    }
    sum * STRENGTH / suns.len() as f64
}

#[test]
fn a_glossy_plane_is_what_fine_quadrature_gives() {
    let site = site(&[flat(5.0)]);
    let at = DVec3::new(-25.0, 3.0, 9.0);
    let normal = DVec3::new(1.0, 0.0, 0.2).normalize();
    // Mirrored directions of points on the plane: in its middle, near an edge, outside, far off.
    let towards = |x: f64, y: f64| {
        let out = at - DVec3::new(x, y, 0.0);
        DVec3::new(-out.x, -out.y, out.z)
    };
    let suns =
        [towards(0.0, 0.0), towards(-4.9, 2.0), towards(9.0, 1.0), DVec3::new(-0.3, 0.4, 0.8)];
    for (alpha, n) in [(0.3, 200), (0.1, 400), (0.05, 700), (0.02, 1600)] {
        let bsdf = model(&Model::PvGlass { index: 1.52, ggx_alpha: alpha, cell_reflectance: 0.04 });
        let timeline = timeline(&suns, 1e-4);
        let year = year(&site, &timeline, &bsdf, at, normal);
        for (i, sun) in suns.iter().enumerate() {
            let expected = brute(&bsdf, 5.0, n, at, normal, &[*sun]);
            let found = year.surface_w_m2[i];
            let (miss, bound) = (found / expected - 1.0, year.error_w_m2[i] / expected);
            println!("alpha {alpha}, sun {i}: {found:.5} W/m2, {miss:.1e}, bound {bound:.1e}");
            assert!(miss.abs() < 1e-3, "alpha {alpha}, sun {i}: {found} {expected}");
            assert!(miss.abs() < bound + 3e-4, "beyond its bound");
        }
    }
}

/// A file that scatters evenly.
fn measured(per_sr: f64) -> Bsdf {
    let text = format!(
        "<WindowElement><Optical><Layer><DataDefinition><IncidentDataStructure>TensorTree4</IncidentDataStructure></DataDefinition><WavelengthData><Wavelength>Visible</Wavelength><WavelengthDataBlock><WavelengthDataDirection>Reflection Back</WavelengthDataDirection><AngleBasis>LBNL/Shirley-Chiu</AngleBasis><ScatteringData>{{{per_sr}}}</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>"
    );
    let file = BsdfFile::parse(&text, "test.xml").expect("a good file");
    Bsdf::Measured(file.reflection(Side::Front, None).expect("has it"))
}

/// A receiver's own plane cuts through the PV: where a part of a cell is seen whose middle lies
/// behind that plane, no point of the cell stands for it.
#[test]
fn a_measured_plane_is_seen_by_a_receiver_that_stands_on_its_edge() {
    let site = site(&[flat(5.0)]);
    let (file, even) = (measured(0.1), model(&Model::Lambertian { reflectance: 0.1 * PI }));
    let timeline = timeline(&[DVec3::new(-0.5, 0.3, 0.8)], 0.533);
    for (i, height_m) in [0.3, 2.0, 12.0].into_iter().cycle().take(60).enumerate() {
        let at = DVec3::new(-5.0 + 0.17 * i as f64, 0.2, height_m);
        let [file, even] = [&file, &even].map(|b| year(&site, &timeline, b, at, DVec3::X));
        let (found, expected) = (file.surface_w_m2[0], even.surface_w_m2[0]);
        let bound = file.error_w_m2[0] + even.error_w_m2[0];
        println!("{at}: {found:.5} W/m2, expected {expected:.5}, bound {bound:.1e}");
        assert!((expected > 0.0) == (at.x < 5.0));
        assert!((found - expected).abs() <= bound, "{at}: {found} {expected} {bound}");
        // Close to the far edge all that is seen is a border.
        assert!((found - expected).abs() <= 1e-3 * expected || at.x > 4.5, "{at}");
    }
}

#[test]
fn the_suns_disc_is_integrated() {
    let site = site(&[flat(1.0)]);
    let normal = DVec3::X;
    let radius = 0.5 * 0.533_f64.to_radians();
    // Smooth and rough, from on high and at a grazing angle, where discs are looked at as lines.
    for (alpha, height_m, n, most) in [
        (0.3, 2.5, 40, 1e-4),
        (0.05, 2.5, 80, 3e-4),
        (0.02, 2.5, 80, 3e-4),
        (0.01, 2.5, 80, 3e-4),
        (0.006, 12.0, 100, 1e-3),
        (0.003, 20.0, 160, 3e-3),
        (0.05, 0.8, 100, 1e-3),
        (0.02, 0.8, 120, 1e-3),
    ] {
        let at = DVec3::new(-25.0, 1.0, height_m);
        let sun = DVec3::new(25.0, -1.0, height_m).normalize();
        let frame = Frame::around(sun);
        let mut disc = Vec::new();
        for i in 0..12 {
            for j in 0..24 {
                let r = libm::sqrt((f64::from(i) + 0.5) / 12.0) * radius;
                let a = 2.0 * PI * (f64::from(j) + 0.5 * f64::from(i % 2)) / 24.0;
                disc.push(frame.z + frame.x * (r * libm::cos(a)) + frame.y * (r * libm::sin(a)));
            }
        }
        let bsdf = model(&Model::PvGlass { index: 1.52, ggx_alpha: alpha, cell_reflectance: 0.04 });
        let year = year(&site, &timeline(&[sun], 0.533), &bsdf, at, normal);
        let expected = brute(&bsdf, 1.0, n, at, normal, &disc);
        let point = brute(&bsdf, 1.0, n, at, normal, &[sun]);
        let found = year.surface_w_m2[0];
        let (miss, bound) = (found / expected - 1.0, year.error_w_m2[0] / expected);
        println!(
            "alpha {alpha}, {height_m} m: {miss:.1e}, bound {bound:.1e}; a point sun would miss {:.1e}",
            point / expected - 1.0
        );
        assert!(miss.abs() < most, "alpha {alpha}, {height_m} m: {found} {expected}");
    }
}

#[test]
fn what_stands_in_the_way_takes_its_part_on_both_sides() {
    let wall = |x: f64, low: f64, high: f64| {
        let corner = |y, z| DVec3::new(x, y, z);
        [corner(-50.0, low), corner(50.0, low), corner(50.0, high), corner(-50.0, high)]
    };
    let bsdf = model(&Model::Lambertian { reflectance: 0.4 });
    let sun = DVec3::new(1.0, 0.0, 1.0);
    let at = DVec3::new(-20.0, 0.0, 6.0);
    let look = |more: &[[DVec3; 4]]| {
        let quads: Vec<_> = std::iter::once(flat(4.0)).chain(more.iter().copied()).collect();
        year(&site(&quads), &timeline(&[sun], 0.5), &bsdf, at, DVec3::X).surface_w_m2[0]
    };
    let free = look(&[]);
    assert!(free > 0.0);
    assert_eq!(look(&[wall(-5.0, 0.0, 9.0)]), 0.0);
    assert_eq!(look(&[wall(4.5, 0.0, 20.0)]), 0.0);
    // A wall whose shadow ends in the middle: those parts are farther off and lower.
    let half = look(&[wall(4.5, 0.0, 4.5)]) / free;
    assert!((0.5..0.65).contains(&half), "{half}");
    // The sun's shadow and the wall before the spot cover the whole together.
    let low = look(&[wall(-4.5, 0.0, 1.2)]) / free;
    assert!(low > 0.0 && low < 1.0, "{low}");
}

/// Keeps tiles in memory; refuses after some.
#[derive(Default)]
struct Kept {
    tiles: Mutex<BTreeMap<TileRect, Vec<SeriesEntry>>>,
    most: usize,
}

impl TileSink for Kept {
    fn has(&self, tile: TileRect) -> bool {
        self.tiles.lock().expect("unpoisoned").contains_key(&tile)
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let mut tiles = self.tiles.lock().expect("unpoisoned");
        if tiles.len() >= self.most {
            return Err(std::io::Error::other("stopped").into());
        }
        let in_order =
            |w: &[SeriesEntry]| (w[0].timestep, w[0].pixel) < (w[1].timestep, w[1].pixel);
        assert!(entries.windows(2).all(in_order));
        assert!(tiles.insert(tile, entries.to_vec()).is_none());
        Ok(())
    }
}

#[test]
fn a_view_goes_on_where_it_stopped() {
    let quads = [flat(2.0), flat(50.0).map(|c| c - DVec3::Z * 5.0)];
    let site = site(&quads);
    let suns: Vec<_> = (1..12).map(|i| DVec3::new(f64::from(i) - 6.0, 1.0, 2.0)).collect();
    let timeline = timeline(&suns, 0.533);
    let bsdf = model(&Model::PvGlass { index: 1.52, ggx_alpha: 0.1, cell_reflectance: 0.04 });
    let scene = DirectScene {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&bsdf],
        max_path_m: 30.0,
        sun_visibility: true,
    };
    let sight = PvSight::new(&site, &timeline, true, &Silent).expect("looks");
    let direct = Direct::new(scene, &sight).expect("fits");
    // A wall of 70 x 40 pixels that looks at the PV, with sky in between.
    let (columns, rows) = (70, 40);
    let mut hits = vec![Hit::nothing(HitKind::Sky); columns * rows];
    for (i, hit) in hits.iter_mut().enumerate().filter(|(i, _)| i % 7 != 0) {
        hit.kind = HitKind::Receiver;
        let (column, row) = (i % columns, i / columns);
        hit.position = Vec3::new(-15.0, column as f32 * 0.3 - 10.0, 8.0 - row as f32 * 0.2);
        hit.normal = Vec3::X;
    }
    let hits = HitMap { columns, rows, hits };
    let sums = Mutex::new(BTreeMap::new());
    let keep = |tile: TileRect, year: &TileYear| {
        sums.lock().expect("unpoisoned").insert(tile, year.clone());
        Ok(())
    };
    let facing = Kept { most: 100, ..Kept::default() };
    let run = |sink: &Kept| {
        let other = Some((Irradiance::FacingBeam, &facing as &dyn TileSink));
        let sinks = DirectSinks { series: (Irradiance::Surface, sink), other, keep: &keep };
        direct_series(&direct, &hits, sinks, &Silent)
    };
    let mut halfway = Kept { most: 3, ..Kept::default() };
    assert!(run(&halfway).is_err());
    halfway.most = 100;
    let rest = run(&halfway).expect("goes on");
    assert_eq!((rest.tiles_present, rest.tiles_rendered), (3, 3));
    let whole = Kept { most: 100, ..Kept::default() };
    let all = run(&whole).expect("runs");
    assert_eq!(all.tiles_rendered, 6);
    let (a, b) = (halfway.tiles.into_inner(), whole.tiles.into_inner());
    let b = b.expect("unpoisoned");
    assert_eq!(a.expect("unpoisoned"), b);
    // The year's sums are those of the series: two hours for each timestep.
    for (tile, sums) in sums.into_inner().expect("unpoisoned") {
        let mut own = vec![0.0_f64; tile.pixels()];
        for e in &b[&tile] {
            own[usize::from(e.pixel)] += 2.0 * f64::from(e.irradiance_w_m2);
        }
        for (own, sum) in own.iter().zip(&sums.surface_wh_m2) {
            assert!((own - f64::from(*sum)).abs() <= 1e-5 * own);
        }
    }
    // On planes that face the beams no less arrives than on the wall.
    let facing = facing.tiles.into_inner().expect("unpoisoned");
    assert_eq!(facing.len(), b.len());
    for (on_wall, facing) in b.values().zip(facing.values()) {
        assert_eq!(on_wall.len(), facing.len());
        let pairs = on_wall.iter().zip(facing);
        assert!(pairs.clone().all(|(s, n)| (s.timestep, s.pixel) == (n.timestep, n.pixel)));
        assert!(pairs.clone().all(|(s, n)| n.irradiance_w_m2 >= s.irradiance_w_m2));
    }
    assert!(all.lit_pixels > 1000 && all.lit_timesteps > 10_000, "{all:?}");
    // Beyond 30 m nothing arrives.
    let far = Hit { position: Vec3::new(-40.0, 0.0, 8.0), ..hits.hits[1] };
    let mut year = DirectYear::default();
    let (p, n) = (far.position.as_dvec3(), far.normal.as_dvec3());
    direct.year(p, n, &mut DirectScratch::default(), &mut year);
    assert!(year.lit.is_empty());
}

/// A scene whose second quad is a crown that lets `january` and `june` through.
fn with_a_crown(quads: &[[DVec3; 4]], january: f64, june: f64) -> Site {
    let mut site = site(quads);
    let leaves = Material { name: "leaves".into(), ..site.materials[0].clone() };
    site.materials.push(leaves);
    site.objects.push(Object { id: "oak".into(), kind: String::new() });
    site.faces[1] = Face { object: 1, material: 1, pv: None };
    let mut transmittance = [january; 12];
    transmittance[5] = june;
    let season = Season { modifier: "leaves".into(), transmittance };
    site.crowns = Crowns::of(&site, &[season]);
    site
}

/// A crown that covers all: the open scene's irradiance times what it lets through; one that covers
/// a part: straight between the open and the opaque scene.
#[test]
fn a_crown_lets_its_share_through_by_month() {
    let at = DVec3::new(-12.0, 1.0, 6.0);
    let mut both = timeline(&[DVec3::new(0.5, 0.1, 0.4), DVec3::new(0.5, 0.1, 0.4)], 0.533);
    both.steps[1].day = 165;
    let upright = |x: f64, low: f64, high: f64, top: f64| {
        [[x, low, -9.0], [x, high, -9.0], [x, high, top], [x, low, top]].map(DVec3::from_array)
    };
    let to_spot = (upright(-6.0, -40.0, 40.0, 40.0), 1);
    let to_sun = (upright(6.0, -40.0, 40.0, 60.0), 1);
    // A roof over all: on the way from the sun and to the spot.
    let over = flat(300.0).map(|p| p + DVec3::Z * 3.0);
    let part = (upright(-4.0, -1.0, 0.6, 2.2), 0);
    let models = [
        Model::PvGlass { index: 1.52, ggx_alpha: 0.05, cell_reflectance: 0.04 },
        Model::Glass { index: 1.52 },
        Model::Lambertian { reflectance: 0.3 },
    ];
    let (january, june) = (0.37, 0.8);
    for (i, m) in models.iter().enumerate() {
        let bsdf = model(m);
        // So that the mirrored sun stands in the square, seen from the spot.
        let sun = DVec3::new(-(at.x - 0.5), -(at.y - 0.2), at.z).normalize();
        both.steps.iter_mut().for_each(|s| s.sun = sun);
        let of = |site: &Site| year(site, &both, &bsdf, at, (-at).normalize());
        let open = of(&site(&[flat(3.0)]));
        assert!(open.surface_w_m2[0] > 1e-3);
        for (crown, ways) in [to_spot, to_sun, (over, 2), part] {
            let quads = [flat(3.0), crown];
            let found = of(&with_a_crown(&quads, january, june));
            let opaque = of(&site(&quads));
            for (t, share) in [january, june].into_iter().enumerate() {
                let (o, c) = (open.surface_w_m2[t], opaque.surface_w_m2[t]);
                let (passes, allowed) = match ways {
                    0 => (share * o + (1.0 - share) * c, 1e-2 * o),
                    n => (share.powi(n) * o, 2e-4 * o),
                };
                let value = found.surface_w_m2[t];
                println!("{i}, {ways} ways, {share}: {value:.5} {passes:.5} of {o:.5}, {c:.5}");
                assert!((value - passes).abs() <= allowed, "{i} {ways} {share}");
                if ways > 0 {
                    assert_eq!(c, 0.0);
                    // An even crown leaves nothing in doubt.
                    assert!(found.error_w_m2[t] <= 1.01 * open.error_w_m2[t]);
                }
            }
        }
    }
}
