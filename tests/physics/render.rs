//! Primary hits on a known scene, and irradiance from photon clouds of known mean.

mod edges;
pub mod gather;

use std::f64::consts::PI;

use glam::{DVec3, Vec3, dvec3, vec3};
use glintmap::base::{Aabb, Silent, Timeline, Timestep};
use glintmap::render::{Hit, HitKind, HitMap, View, background, hits, representative_suns};
use glintmap::site::{Bvh, Face, Material, Object, PvSurface, Site, Triangle};

/// Builds scenes from quads; what a reader of files would do.
#[derive(Default)]
struct Builder {
    triangles: Vec<Triangle>,
    faces: Vec<Face>,
    objects: Vec<Object>,
    pv: Vec<PvSurface>,
}

impl Builder {
    fn polygon(&mut self, name: &str, corners: &[Vec3], pv: bool) {
        let face = self.faces.len() as u32;
        let object = match self.objects.iter().position(|o| o.id == name) {
            Some(at) => at,
            None => {
                self.objects.push(Object { id: name.to_owned(), kind: String::new() });
                self.objects.len() - 1
            }
        };
        let first = self.triangles.len() as u32;
        for i in 1..corners.len() - 1 {
            let corners = [corners[0], corners[i], corners[i + 1]];
            self.triangles.push(Triangle { corners, face });
        }
        let number = pv.then(|| {
            let own: Vec<u32> = (first..self.triangles.len() as u32).collect();
            let of = |t: &u32| &self.triangles[*t as usize];
            self.pv.push(PvSurface {
                name: name.to_owned(),
                entry: 0,
                normal: of(&first).normal().as_dvec3(),
                area_m2: own.iter().map(|t| f64::from(of(t).area_m2())).sum(),
                triangles: own,
                two_sided: false,
            });
            (self.pv.len() - 1) as u16
        });
        self.faces.push(Face { object: object as u32, material: 0, pv: number });
    }

    /// A box without a bottom.
    fn block(&mut self, name: &str, low: Vec3, high: Vec3) {
        let c = |x: f32, y: f32, z: f32| vec3(x, y, z);
        let (l, h) = (low, high);
        let ring = [c(l.x, l.y, 0.0), c(h.x, l.y, 0.0), c(h.x, h.y, 0.0), c(l.x, h.y, 0.0)];
        for i in 0..4 {
            let (a, b) = (ring[i], ring[(i + 1) % 4]);
            let at = |p: Vec3, z: f32| c(p.x, p.y, z);
            self.polygon(name, &[at(a, l.z), at(b, l.z), at(b, h.z), at(a, h.z)], false);
        }
        self.polygon(name, &ring.map(|p| c(p.x, p.y, h.z)), false);
    }

    fn site(self) -> Site {
        let corners = self.triangles.iter().flat_map(|t| t.corners);
        let grey = Material { name: "grey".to_owned(), reflectance: [0.25; 3], diffuse: true };
        Site {
            bounds: Aabb::around(corners),
            bvh: Bvh::build(&self.triangles),
            triangles: self.triangles,
            faces: self.faces,
            objects: self.objects,
            materials: vec![grey],
            pv: self.pv,
            origin: DVec3::ZERO,
            crowns: None,
            findings: Vec::new(),
        }
    }
}

/// Ground at z = 0, a block of 8 m over x 0..1, and a PV roof over x 8..10 that faces west and up.
fn scene() -> Site {
    let mut b = Builder::default();
    let (w, e) = (-30.0, 30.0);
    b.polygon("ground", &[vec3(w, w, 0.), vec3(e, w, 0.), vec3(e, e, 0.), vec3(w, e, 0.)], false);
    b.block("block", vec3(0.0, -10.0, 0.0), vec3(1.0, 10.0, 8.0));
    b.polygon("roof", &ROOF, true);
    b.site()
}

const ROOF: [Vec3; 4] =
    [vec3(8.0, -2.0, 3.0), vec3(10.0, -2.0, 5.0), vec3(10.0, 2.0, 5.0), vec3(8.0, 2.0, 3.0)];

/// Distance to the nearest of many points on the roof.
fn roof_distance(from: Vec3) -> f32 {
    let mut nearest = f32::INFINITY;
    for i in 0..=100 {
        for j in 0..=100 {
            let (u, v) = (i as f32 / 100.0, j as f32 / 100.0);
            let p = ROOF[0] + (ROOF[1] - ROOF[0]) * u + (ROOF[3] - ROOF[0]) * v;
            nearest = nearest.min(p.distance(from));
        }
    }
    nearest
}

const PLAN: &str = "-vtl -vp 0 0 20 -vd 0 0 -1 -vu 0 1 0 -vh 80 -vv 80";

#[test]
fn hits_on_a_known_scene_are_of_the_right_kind() {
    let site = scene();
    assert!(site.pv[0].normal.x < 0.0 && site.pv[0].normal.z > 0.0, "{:?}", site.pv[0].normal);
    let view = View::parse(PLAN, 160, 160).expect("parses");
    let map = hits(&view, &site, 7.0, 1, &Silent).expect("traces");
    let at = |x: f64, y: f64| {
        let (c, r) = view.pixel_of(dvec3(x, y, 0.0)).expect("in the picture");
        *map.at(c, r)
    };
    for (x, y, kind, object) in [
        (4.2, 0.2, HitKind::Receiver, "ground"),
        (1.8, 0.2, HitKind::Beyond, "ground"), // more than 7 m from the roof's foot
        (6.2, 0.2, HitKind::Hidden, "ground"), // below the plane of the roof
        (12.2, 0.2, HitKind::Hidden, "ground"),
        (-5.2, 0.2, HitKind::Hidden, "ground"), // behind the block
        (0.6, 0.2, HitKind::Hidden, "block"),   // on top of it: the roof lies lower
        (9.2, 0.2, HitKind::Pv, "roof"),
    ] {
        let hit = at(x, y);
        assert_eq!(hit.kind, kind, "at {x}, {y}: {hit:?}");
        assert_eq!(site.objects[hit.object as usize].id, object, "at {x}, {y}");
        assert_eq!(site.faces[hit.face as usize].object, hit.object);
        assert!(hit.normal.z > 0.5, "turned to the viewer");
        let z = [0.0, 8.0][usize::from(object == "block")];
        if kind != HitKind::Pv {
            assert!((hit.position.z - z).abs() < 1e-4, "{hit:?}");
        }
    }
    assert_eq!(at(35.0, 0.0), Hit::nothing(HitKind::Sky));
    let mut receivers = 0;
    for hit in &map.hits {
        assert!(hit.position.is_finite() && hit.normal.is_finite());
        match hit.kind {
            HitKind::Receiver | HitKind::Beyond => {
                let true_m = roof_distance(hit.position);
                let found = hit.pv_distance_m;
                assert!(found > true_m - 0.01, "{found}, true {true_m}");
                // Between block and roof nothing stands before it; its points lie 0.4 m apart.
                if (1.1..4.5).contains(&hit.position.x) {
                    assert!(found < true_m + 0.6, "{found}, true {true_m}");
                }
                assert_eq!(hit.kind == HitKind::Receiver, f64::from(found) <= 7.0);
                receivers += 1;
            }
            _ => assert_eq!(hit.pv_distance_m, 0.0, "{hit:?}"),
        }
    }
    assert!(receivers > 500, "{receivers}");
}

#[test]
fn clipping_planes_cut_and_projections_end() {
    let site = scene();
    let count = |options: &str, kind: HitKind| {
        let view = View::parse(options, 160, 160).expect("parses");
        let map = hits(&view, &site, 100.0, 1, &Silent).expect("traces");
        map.hits.iter().filter(|h| h.kind == kind).count()
    };
    // The ground lies 20 m below the view point, everything else nearer.
    assert_eq!(count(PLAN, HitKind::Clipped), 0);
    let aft = format!("{PLAN} -va 19");
    let (cut, sky) = (count(&aft, HitKind::Clipped), count(PLAN, HitKind::Sky));
    assert_eq!(count(&aft, HitKind::Sky), sky, "what is cut isn't sky");
    assert!(cut > 1000, "{cut}");
    // Behind the fore plane at 3.5 m above the ground: no block's top, half a roof.
    let pv = count(PLAN, HitKind::Pv);
    let fore = count(&format!("{PLAN} -vo 16"), HitKind::Pv);
    assert!(fore > 0 && fore < pv, "{fore} of {pv}");
    // The corners of a fisheye show nothing: 1 - pi/4 of the picture.
    let fisheye = "-vta -vp -5 0 2 -vd 0 0 1 -vu 0 1 0 -vh 180 -vv 180";
    let view = View::parse(fisheye, 200, 200).expect("parses");
    let map = hits(&view, &site, 100.0, 1, &Silent).expect("traces");
    let outside = map.hits.iter().filter(|h| h.kind == HitKind::Clipped).count() as f64;
    // The projection's circle has the diameter of a 360 degree picture: nothing is outside here.
    assert_eq!(outside, 0.0);
    let full = fisheye.replace("180 -vv 180", "360 -vv 360");
    let view = View::parse(&full, 200, 200).expect("parses");
    let map = hits(&view, &site, 100.0, 1, &Silent).expect("traces");
    let outside = map.hits.iter().filter(|h| h.kind == HitKind::Clipped).count() as f64;
    assert!((outside / 40_000.0 - (1.0 - PI / 4.0)).abs() < 0.005, "{outside}");
}

fn pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(work)
}

fn two_suns() -> Vec<(DVec3, f64)> {
    vec![(dvec3(-0.5, -0.6, 0.6), 2.0), (dvec3(0.4, -0.6, 0.7), 1.0)]
}

#[test]
fn threads_change_nothing_and_the_file_gives_hits_back() {
    let site = scene();
    let view = View::parse("-vtc -vp 4 0 3 -vd 0 1 0 -vh 360 -vv 90", 90, 70).expect("parses");
    let both = [1, 2].map(|threads| {
        pool(threads, || {
            let map = hits(&view, &site, 7.0, 1, &Silent).expect("traces");
            let picture = background(&view, &map, &site, &two_suns(), &Silent).expect("paints");
            (map, picture)
        })
    });
    assert_eq!(both[0], both[1]);
    let map = &both[0].0;
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hits.gmh");
    map.write(&path, &view, 7.0, &glintmap::base::Provenance::default()).expect("writes");
    let (back, facts) = HitMap::read(&path).expect("reads");
    assert_eq!(&back, map);
    assert_eq!(View::parse(&facts.view, 90, 70).expect("parses"), view);
    assert_eq!(facts.max_path_m, 7.0);
    let kinds = [HitKind::Receiver, HitKind::Sky, HitKind::Pv, HitKind::Beyond, HitKind::Hidden];
    for kind in kinds {
        assert!(map.hits.iter().any(|h| h.kind == kind), "no {kind:?} in the picture");
    }
}

#[test]
fn the_background_has_sun_and_shadow_and_dark_blue_pv() {
    let site = scene();
    let view = View::parse(PLAN, 160, 160).expect("parses");
    let map = hits(&view, &site, 100.0, 1, &Silent).expect("traces");
    let sun = [(dvec3(1.0, 0.0, 1.0), 1.0)];
    let picture = background(&view, &map, &site, &sun, &Silent).expect("paints");
    let at = |x: f64, y: f64| {
        let (c, r) = view.pixel_of(dvec3(x, y, 0.0)).expect("in the picture");
        Vec3::from_array(picture[(c, r)])
    };
    // The sun stands 45 degrees high in the east: the block throws 8 m of shadow to the west.
    let (lit, shadow) = (at(-20.2, 0.2), at(-4.2, 0.2));
    assert!(shadow.x < 0.6 * lit.x, "shadow {shadow}, lit {lit}");
    let pv = at(9.2, 0.2);
    assert!(pv.z > 1.5 * pv.x && pv.x < 0.5 * lit.x, "{pv}");
    assert!(picture.data().iter().flatten().all(|v| v.is_finite() && (0.0..2.0).contains(v)));
}

#[test]
fn representative_suns_share_out_the_energy() {
    let step = |hour: f64, irradiance_w_m2: f64| Timestep {
        day: 0,
        hour,
        sun: dvec3(0.0, -1.0, hour).normalize(),
        irradiance_w_m2,
        weight_h: 0.5,
        segment: 0,
    };
    let timeline = Timeline {
        steps: (0..100).map(|i| step(f64::from(i), if i < 50 { 300.0 } else { 100.0 })).collect(),
        step_h: 0.5,
        year: 2025,
        half_year: false,
        sun_diameter_deg: 0.533,
        basis: glintmap::base::SpectralBasis::Broadband,
    };
    let suns = representative_suns(&timeline, 8);
    assert_eq!(suns.len(), 8);
    let total: f64 = suns.iter().map(|(_, w)| w).sum();
    assert!((total - (50.0 * 300.0 + 50.0 * 100.0) * 0.5).abs() < 1e-9);
    let early = suns.iter().filter(|(d, _)| d.z < step(49.5, 1.0).sun.z).count();
    assert_eq!(early, 6, "three quarters of the energy come first");
    assert!(representative_suns(&timeline, 0).is_empty());
}
