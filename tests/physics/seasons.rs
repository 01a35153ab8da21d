//! Crowns that let light through: the wall of the tiny scene plays the tree.

use std::fs;

use glintmap::base::Grid;
use glintmap::picture::exr;

use crate::support::program::{project, succeed};

/// Mean annual exposure of the wall and of the ground behind it, the photons of each timestep, and
/// what direct integration gives behind the wall.
fn look(transmittance: Option<f64>) -> ([f64; 2], String, Vec<f32>) {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a name");
    let file = folder.join("project.toml");
    let before = fs::read_to_string(&file).expect("reads");
    let season = transmittance.map_or(String::new(), |t| {
        // Only June is computed.
        format!("[[season]]\nmodifier = \"plaster\"\ntransmittance = [0,0,0,0,0,{t},0,0,0,0,0,0]\n")
    });
    // Ground beyond the wall, where photons land that pass it; two places on it without photons.
    fs::write(folder.join("behind.txt"), "-17 -1 0 0 0 1\n-18 2 0 0 0 1\n").expect("writes");
    let direct = "[[view]]\nname = \"exact\"\nsensors = \"behind.txt\"\nestimator = \"direct\"\n";
    let region =
        "[[region]]\nname = \"Behind\"\npolygon = [[-20, -6], [-15.2, -6], [-15.2, 6], [-20, 6]]\n";
    fs::write(&file, format!("{before}\n{direct}\n{region}\n{season}")).expect("writes");
    succeed(&["run", path, "--quiet", "--until", "glare", "--set", "photons.stored=40000"]);
    let text = fs::read_to_string(folder.join("run/standard/receivers/receivers.json"));
    let found: serde_json::Value = serde_json::from_str(&text.expect("reads")).expect("JSON");
    let groups = found["groups"].as_array().expect("groups");
    let mean = |name: &str| {
        let group = groups.iter().find(|g| g["name"] == name).expect(name);
        group["annual_mean_wh_m2"].as_f64().expect("a number")
    };
    let store = folder.join("run/standard/photons.gmp");
    let store = store.to_str().expect("a name");
    let steps = succeed(&["inspect", store, "--per-timestep"]).out;
    let exact = glintmap_formats::npy::Reader::open(&folder.join("run/standard/exact/annual.npy"))
        .and_then(|reader| reader.read_all());
    ([mean("The wall"), mean("Behind")], steps, exact.expect("numbers"))
}

#[test]
fn a_crown_keeps_its_share_and_passes_the_rest() {
    let (opaque, photons, _) = look(None);
    // Written down as opaque, photon by photon the same.
    let (closed, same, dark) = look(Some(0.0));
    assert_eq!((opaque, photons), (closed, same));
    let (open, _, all) = look(Some(1.0));
    let (half, _, part) = look(Some(0.4));
    println!("wall and ground behind: opaque {opaque:?}, half {half:?}, open {open:?}");
    assert!(opaque[0] > 0.0 && opaque[1] < 0.02 * open[1]);
    assert_eq!(open[0], 0.0);
    // Without photons: the wall hides these places, or weakens their light to its share.
    println!("behind: {dark:?}, {part:?} of {all:?} Wh/m2");
    for ((dark, part), all) in dark.iter().zip(&part).zip(&all) {
        assert!(*dark == 0.0 && *all > 0.0 && (part / all - 0.4).abs() < 1e-3);
    }
    assert!((half[0] / opaque[0] - 0.6).abs() < 0.06, "{half:?} {opaque:?}");
    assert!((half[1] / open[1] - 0.4).abs() < 0.08, "{half:?} {open:?}");
}

/// A moment behind the wall: its picture, and the irradiance that the PV gives the eye.
fn moment(transmittance: f64) -> (Grid<f32>, f64) {
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let before = fs::read_to_string(&file).expect("reads");
    let season = format!(
        "[[season]]\nmodifier = \"plaster\"\ntransmittance = [0,0,0,0,0,{transmittance},0,0,0,0,0,0]\n"
    );
    let moment = "[[moment]]\nname = \"m\"\ndate = \"06-14\"\ntime = \"07:30\"\nsize = [160, 80]\n\
        view = \"-vtv -vp -18 -1 1 -vd 1 0 0.16 -vu 0 0 1 -vh 30 -vv 15\"\n";
    fs::write(&file, format!("{before}\n{moment}\n{season}")).expect("writes");
    succeed(&["run", folder.to_str().expect("a name"), "--quiet", "--until", "pictures"]);
    let made = folder.join("run/standard/moments");
    let picture = exr::read(&made.join("m.exr")).expect("a picture");
    let picture = picture.get("luminance.cd_m2").expect("the channel").clone();
    let facts = fs::read_to_string(made.join("m.json")).expect("facts");
    let facts: serde_json::Value = serde_json::from_str(&facts).expect("JSON");
    (picture, facts["pv"]["irradiance_w_m2"].as_f64().expect("a number"))
}

#[test]
fn moments_show_what_stands_behind_a_crown_by_its_share() {
    let [(crown, none), (part, some), (behind, all)] = [0.0, 0.4, 1.0].map(moment);
    println!("the PV gives the eye {none}, {some} and {all} W/m2");
    // Borders of what the crown hides are found by halving, for each share anew: 6e-6 apart.
    assert!(none == 0.0 && all > 0.0 && (some / all - 0.4).abs() < 2e-5);
    // Every pixel is a mixture of the crown and of what stands behind it; light from the sky,
    // which comes through the crown, too, changes what both show by little.
    let mut dazzling = 0;
    for ((crown, part), behind) in crown.data().iter().zip(part.data()).zip(behind.data()) {
        let expected = 0.6 * crown + 0.4 * behind;
        assert!((part / expected - 1.0).abs() < 0.05, "{part} cd/m2 of {crown} and {behind}");
        if *behind > 20.0 * crown {
            dazzling += 1;
            assert!((part / expected - 1.0).abs() < 0.01, "{part} cd/m2 of {crown} and {behind}");
        }
    }
    assert!(dazzling > 50, "{dazzling} pixels show the dazzling PV");
}
