//! PV by polygon, arrays of PV that no file holds, and true north.

use super::*;
use glintmap::site::{Coordinates, NorthSource, PvArray, azimuth_deg};

fn select_in(polygon: &[[f64; 2]], coordinates: Coordinates, select: Select) -> Select {
    Select { polygon: Some(polygon.to_vec()), coordinates, ..select }
}

#[test]
fn a_polygon_cuts_a_roof_in_two() {
    let files = Files::new();
    // The roof lies over [0, 6] x [0, 8]; the polygon takes its west and reaches beyond it.
    let west = [[-5.0, -5.0], [2.0, -5.0], [2.0, 20.0], [-5.0, 20.0]];
    let whole = files.load("a.rad", SCENE, Some(modifier("pv"))).unwrap();
    let half = select_in(&west, Coordinates::Local, modifier("pv"));
    let site = files.load("a.rad", SCENE, Some(half)).unwrap();
    assert_eq!(site.pv.len(), 1);
    assert!((site.pv[0].area_m2 - whole.pv[0].area_m2 / 3.0).abs() < 1e-4);
    assert_eq!(site.pv[0].normal, whole.pv[0].normal);
    let area = |site: &Site| site.triangles.iter().map(|t| f64::from(t.area_m2())).sum::<f64>();
    assert!((area(&site) - area(&whole)).abs() < 1e-3);
    assert_eq!(site.faces.len(), whole.faces.len() + 1);
    // Two entries share a roof.
    let east = [[2.0, -5.0], [9.0, -5.0], [9.0, 20.0], [2.0, 20.0]];
    let path = files.write("two.rad", SCENE);
    let entry = |name: &str, polygon: &[[f64; 2]]| PvSpec {
        name: name.into(),
        select: select_in(polygon, Coordinates::Local, modifier("pv")),
        two_sided: false,
    };
    let both =
        Site::load(&SceneSpec::of([&path]), &[entry("w", &west), entry("e", &east)]).unwrap();
    let names: Vec<&str> = both.pv.iter().map(|p| p.name.as_str()).collect();
    assert_eq!((names, both.faces.len()), (vec!["w", "e"], whole.faces.len() + 1));
    let sum: f64 = both.pv.iter().map(|p| p.area_m2).sum();
    assert!((sum - whole.pv[0].area_m2).abs() < 1e-4);
    // Where they overlap, the first has it.
    let far = [[50.0, 50.0], [60.0, 50.0], [60.0, 60.0]];
    let ask = |polygon: &[[f64; 2]]| {
        let select = select_in(polygon, Coordinates::Local, modifier("pv"));
        files.refusal("a.rad", SCENE, Some(select))
    };
    says(&ask(&far), &["polygon = 3 points", "none lies in the polygon (x 50 to 60", "\"map\""]);
    says(&ask(&far[..2]), &["[[pv]] roof", "polygon of 2 points encloses no area"]);
    says(&ask(&[[f64::NAN, 0.0], [1.0, 0.0], [0.0, 1.0]]), &["encloses no area"]);
}

const TRANSLATE: &str = "\"translate\":[85000.25,446000.5,-3.5]";

/// The house in Dutch map coordinates.
fn mapped() -> String {
    house(ROOF_AND_GROUND).replace("\"translate\":[0,0,0]", TRANSLATE).replace(
        "\"CityObjects\"",
        r#""metadata":{"referenceSystem":"https://www.opengis.net/def/crs/EPSG/0/28992"},"CityObjects""#,
    )
}

#[test]
fn polygons_and_arrays_in_map_coordinates() {
    let files = Files::new();
    let path = files.write("map.city.json", mapped());
    let square = |x: f64, y: f64, edge: f64| {
        vec![[x, y], [x + edge, y], [x + edge, y + edge], [x, y + edge]]
    };
    // The south-western corner of the roof.
    let corner = square(84990.25, 445990.5, 13.0);
    let entries = [
        PvSpec {
            name: "corner".into(),
            select: select_in(&corner, Coordinates::Map, surface("RoofSurface")),
            two_sided: false,
        },
        PvSpec::of_array("field", true),
    ];
    let mut scene = SceneSpec::of([path]);
    let array = PvArray {
        polygon: square(85020.25, 446000.5, 12.0),
        coordinates: Coordinates::Map,
        tilt_deg: 60.0,
        azimuth_deg: 225.0,
        height_m: 10.0,
        row_pitch_m: 3.0,
        module_m: 2.0,
    };
    scene.arrays.push(("field".into(), array));
    // By the map's projection true north isn't the y axis.
    scene.convergence_at = Some([51.9062, 4.4593]);
    let loaded = load(&scene, &entries).unwrap();
    assert_eq!(loaded.north.source, NorthSource::GridConvergence);
    assert!((loaded.north.deg - 0.73186).abs() < 1e-4, "{:?}", loaded.north);
    let site = &loaded.site;
    assert!((site.pv[0].area_m2 - 9.0).abs() < 1e-4, "{}", site.pv[0].area_m2);
    let rows = &site.pv[1..];
    assert_eq!(rows[0].name, "field/1");
    // The diagonal holds 17 m, turned a little.
    assert_eq!(rows.len(), 6);
    for row in rows {
        assert!((azimuth_deg(row.normal).unwrap() - 225.0).abs() < 1e-6 && row.two_sided);
        assert!((tilt_deg(row.normal) - 60.0).abs() < 1e-6);
        for &t in &row.triangles {
            for c in site.triangles[t as usize].corners {
                let map =
                    glintmap::site::map_from_local(c.as_dvec3(), site.origin, loaded.north.deg);
                let inside = (85020.25 - 1e-3..=85032.25 + 1e-3).contains(&map.x)
                    && (446000.5 - 1e-3..=446012.5 + 1e-3).contains(&map.y);
                assert!(
                    inside && (10.0 - 1e-3..=10.0 + 3f64.sqrt() + 1e-3).contains(&map.z),
                    "{map}"
                );
            }
        }
    }
    let text = summarise_loaded(&loaded).to_string();
    says(&text, &["true north: 0.732 degrees clockwise", "EPSG/0/28992", "field/1", "pv array"]);
    // Stated, it is as stated; of an unknown projection it is asked for.
    scene.convergence_at = None;
    assert_eq!(load(&scene, &entries).unwrap().north.source, NorthSource::Stated);
    scene.convergence_at = Some([51.9062, 4.4593]);
    scene.crs = Some("EPSG:3035".into());
    let unknown = load(&scene, &entries).unwrap();
    assert_eq!(unknown.north.source, NorthSource::Unknown);
    says(&summarise_loaded(&unknown).to_string(), &["EPSG:3035 isn't known here; state north_deg"]);
    scene.arrays[0].1.row_pitch_m = 0.1;
    says(&load(&scene, &entries).unwrap_err().to_string(), &["[[pv]] field", "row_pitch_m = 0.1"]);
}

#[test]
fn materials_by_surface_type() {
    let files = Files::new();
    let defined = files.write("types.rad", "void plastic RoofSurface 0 0 5 .6 .2 .1 0 0\n");
    let city = files.write("a.city.json", house(ROOF_AND_GROUND));
    let mut scene = SceneSpec::of([&defined, &city]);
    scene.reflectance.insert("GroundSurface".into(), 0.125);
    let site = Site::load(&scene, &[]).unwrap();
    let of = |kind: &str| {
        let face = site.faces.iter().find(|f| site.objects[f.object as usize].kind == kind);
        let material = &site.materials[face.unwrap().material as usize];
        (material.name.as_str(), material.reflectance)
    };
    assert_eq!(of("RoofSurface"), ("RoofSurface", [0.6, 0.2, 0.1]));
    assert_eq!(of("GroundSurface"), ("GroundSurface", [0.125; 3]));
    scene.reflectance.insert("RoofSurface".into(), 1.5);
    says(&Site::load(&scene, &[]).unwrap_err().to_string(), &["RoofSurface = 1.5"]);
}

#[test]
fn surfaces_that_light_passes_or_that_other_files_hold() {
    let files = Files::new();
    files.write(
        "part.rad",
        "void plastic leaf 0 0 5 .1 .3 .1 0 0\nleaf polygon top 0 0 9 0 0 2 1 0 2 0 1 2\n",
    );
    let text = "\
void plastic wall 0 0 5 .4 .4 .4 0 0
void illum window 1 wall 0 3 9 9 9
void illum open 0 0 3 9 9 9
void BSDF blind 6 0 blind.xml 0 0 1 . 0 0
window polygon a 0 0 9 0 0 0 9 0 0 0 9 0
open polygon b 0 0 9 0 0 1 9 0 1 0 9 1
blind polygon c 0 0 9 0 0 2 9 0 2 0 9 2
wall instance d 5 part.rad -t 0 0 9 0 0
";
    let site = files.load("scene.rad", text, None).unwrap();
    assert_eq!(site.faces.len(), 3);
    let material = |face: usize| site.materials[site.faces[face].material as usize].name.as_str();
    assert_eq!([material(0), material(1), material(2)], ["wall", "blind", "wall"]);
    assert_eq!(site.objects[2].id, "d.top");
    assert_eq!(site.bounds.max.z, 11.0);
    says(&warnings(&site), &["`open` is left out", "BSDF from `blind.xml`, up 0 0 1"]);
}
