//! BSDF files as Radiance reads them: checkBSDF's totals, and values seen by rtrace.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use glintmap::base::{Purpose, Stream};
use glintmap::bsdf::{
    Bsdf, BsdfFile, Fineness, Goniophotometer, Model, Preset, Side, Spectrum, Way, on_hemisphere,
    write, write_points,
};

use crate::support;

/// The folder of Radiance's programs that pyradiance carries.
fn radiance() -> Option<PathBuf> {
    let python = support::python()?;
    let code = "import pyradiance, pathlib; print(pathlib.Path(pyradiance.__file__).parent)";
    let out = Command::new(python).args(["-c", code]).output().expect("Python starts");
    assert!(out.status.success(), "pyradiance is installed");
    Some(PathBuf::from(String::from_utf8_lossy(&out.stdout).trim()))
}

fn run(program: &Path, arguments: &[&str], input: &str) -> String {
    use std::io::Write;
    let mut child = Command::new(program)
        .args(arguments)
        .env("RAYPATH", format!(".:{}", program.parent().unwrap().with_file_name("lib").display()))
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("starts");
    child.stdin.take().unwrap().write_all(input.as_bytes()).expect("takes input");
    let out = child.wait_with_output().expect("ends");
    assert!(out.status.success(), "{}", program.display());
    String::from_utf8_lossy(&out.stdout).into_owned()
}

const FILES: [&str; 4] = [
    "bsdf/klems_full_2011-SA1.xml",
    "bsdf/klems_full_diffuse_glass.xml",
    "bsdf/klems_full_sawtooth_geometry.xml",
    "bsdf/tensortree_rank3_fabric.xml",
];

/// Largest hemispherical reflectance of a side; 0 where the file hasn't it.
fn most(file: &BsdfFile, way: Way) -> f64 {
    let block = file.blocks.iter().find(|b| b.way == way && b.spectrum == Spectrum::Visible);
    block.map_or(0.0, |b| b.most_scattered)
}

/// Largest total of an isotropic tree as checkBSDF sees it: means over 16 steps of the sine, %.
fn most_by_steps(file: &BsdfFile) -> f64 {
    let m = file.reflection(Side::Front, None).unwrap();
    let mean = |bin: u32| {
        let sines = (0..64).map(|k| (f64::from(bin) + (f64::from(k) + 0.5) / 64.0) / 16.0);
        sines.map(|s| m.reflectance(DVec3::new(s, 0.0, (1.0 - s * s).sqrt()))).sum::<f64>() / 64.0
    };
    100.0 * (0..16).map(mean).fold(0.0, f64::max)
}

#[test]
fn what_we_write_is_what_radiance_reads() {
    let Some(radiance) = radiance() else { return };
    let keep = tempfile::tempdir().unwrap();
    for name in ["satinated", "standard", "metal-sheet"] {
        let bsdf = Bsdf::from_model(&Preset::named(name).unwrap().model()).unwrap();
        let written = write(&bsdf, name, Fineness { resolution: 6, prune: 80.0 }).unwrap();
        let path = keep.path().join(format!("{name}.xml"));
        fs::write(&path, &written.text).unwrap();
        let file = BsdfFile::read(&path).expect("ours");
        let said = run(&radiance.join("bin/checkBSDF"), &[path.to_str().unwrap()], "");
        let line = said.lines().find(|l| l.starts_with("Interior Refl")).expect("a row");
        let theirs = line.split_whitespace().find_map(|w| w.strip_suffix('%')).expect("a share");
        let theirs: f64 = theirs.parse().unwrap();
        let ours = most_by_steps(&file);
        assert!((ours - theirs).abs() <= 0.01 * theirs + 0.06, "{name}: {ours}, {theirs}");
        compare(&radiance, &path, Side::Front, 25);
    }
}

/// A satinated glass as a goniophotometer would see it, on rings of 4 degrees.
fn measured(theta_in: f64, bsdf: &Bsdf) -> String {
    let unit = |theta: f64, phi: f64| {
        let (theta, phi) = (theta.to_radians(), phi.to_radians());
        DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    let mut text =
        format!("#sample_name \"satin\"\n#format: theta phi BSDF\n#intheta {theta_in}\n#inphi 0\n");
    for ring in 0..22 {
        let theta = 1.0 + 4.0 * f64::from(ring);
        let around = (6.0 * theta.to_radians().sin() / 4_f64.to_radians()).ceil().max(4.0);
        for i in 0..around as u32 {
            let phi = 360.0 * (f64::from(i) + 0.3) / around;
            let value = bsdf.evaluate(unit(theta_in, 0.0), unit(theta, phi));
            writeln!(text, "{theta:.3}\t{phi:.3}\t{value:.6}").unwrap();
        }
    }
    text
}

#[test]
fn goniophotometer_data_that_pabopto2bsdf_takes_become_the_lobe_they_were_made_from() {
    let Some(radiance) = radiance() else { return };
    let bsdf =
        Bsdf::from_model(&Model::PvGlass { index: 1.52, ggx_alpha: 0.3, cell_reflectance: 0.1 })
            .unwrap();
    let keep = tempfile::tempdir().unwrap();
    let mut paths = Vec::new();
    for theta in [0, 15, 30, 45, 60, 75] {
        let path = keep.path().join(format!("in{theta}.txt"));
        fs::write(&path, measured(f64::from(theta), &bsdf)).unwrap();
        paths.push(path);
    }
    let data = Goniophotometer::read(&paths).expect("good data");
    assert!(data.is_isotropic());
    let fineness = Fineness { resolution: 5, prune: 0.0 };
    let ours = BsdfFile::parse(&write_points(&data, fineness).unwrap().text, "ours.xml").unwrap();
    let ours = Bsdf::Measured(ours.reflection(Side::Front, None).unwrap());
    let out = Command::new(radiance.join("bin/pabopto2bsdf")).args(&paths).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(out.stdout.starts_with(b"#?RADIANCE"), "it takes the same files");
    for degrees in [10.0_f64, 30.0, 52.0, 70.0] {
        let from = DVec3::new(-degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
        let (seen, real) = (ours.reflectance(from), bsdf.reflectance(from));
        // Between 60 and 75 degrees, where nothing was measured, Fresnel's rise is guessed.
        let most = if degrees > 60.0 { 0.08 } else { 0.04 };
        assert!((seen / real - 1.0).abs() < most, "{degrees}: {seen} of {real}");
        let (lobe, real) = (ours.lobe(degrees), bsdf.lobe(degrees));
        assert!((lobe.peak_deg - real.peak_deg).abs() < 12.0, "{degrees}: {lobe:?} {real:?}");
    }
}

#[test]
fn totals_are_those_of_checkbsdf() {
    let Some(radiance) = radiance() else { return };
    for name in FILES {
        let Some(path) = support::data(name) else { return };
        let file = BsdfFile::read(&path).expect("a good file");
        let said = run(&radiance.join("bin/checkBSDF"), &[path.to_str().unwrap()], "");
        for (row, way) in [
            ("Interior Refl", Way::ReflectionBack),
            ("Exterior Refl", Way::ReflectionFront),
            ("Int->Ext Trans", Way::TransmissionBack),
            ("Ext->Int Trans", Way::TransmissionFront),
        ] {
            let line = said.lines().find(|l| l.starts_with(row)).expect("a row");
            let theirs =
                line.split_whitespace().find_map(|w| w.strip_suffix('%')).expect("a share");
            let theirs: f64 = theirs.parse().unwrap();
            let mut ours = 100.0 * most(&file, way);
            if name.contains("tensortree") {
                if way != Way::ReflectionBack {
                    continue;
                }
                ours = most_by_steps(&file);
            }
            assert!(
                (ours - theirs).abs() <= 0.01 * theirs + 0.06,
                "{name} {row}: {ours:.2}, checkBSDF {theirs}"
            );
        }
    }
}

/// `f(in, out)` of each pair by rtrace: a tiny sun over a plane of the material.
fn traced(radiance: &Path, xml: &Path, side: Side, pairs: &[(DVec3, DVec3)]) -> Vec<f64> {
    let keep = tempfile::tempdir().unwrap();
    let mut out = Vec::new();
    fs::copy(xml, keep.path().join("m.xml")).unwrap();
    // The plane's normal is +z; Radiance's back side is looked at from below, with x mirrored.
    let turn = |v: DVec3| match side {
        Side::Front => v,
        Side::Back => DVec3::new(-v.x, v.y, -v.z),
    };
    for (i, (from, to)) in pairs.iter().enumerate() {
        let (from, to) = (turn(*from), turn(*to));
        let angle = 0.02_f64;
        let solid = std::f64::consts::TAU * (1.0 - (angle.to_radians() / 2.0).cos());
        let radiance_w = 1.0 / solid;
        let mut scene = String::new();
        let material = keep.path().join("m.xml");
        writeln!(scene, "void BSDF m 6 0 {} 0 1 0 . 0 0", material.display()).unwrap();
        scene.push_str("m polygon p 0 0 12 -9 -9 0 9 -9 0 9 9 0 -9 9 0\n");
        writeln!(scene, "void light l 0 0 3 {radiance_w} {radiance_w} {radiance_w}").unwrap();
        writeln!(scene, "l source s 0 0 4 {} {} {} {angle}", from.x, from.y, from.z).unwrap();
        let rad = keep.path().join(format!("{i}.rad"));
        let octree = keep.path().join(format!("{i}.oct"));
        fs::write(&rad, scene).unwrap();
        let tree = Command::new(radiance.join("bin/oconv")).arg(&rad).output().unwrap();
        assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
        fs::write(&octree, tree.stdout).unwrap();
        let ray = format!("{} {} {} {} {} {}\n", to.x, to.y, to.z, -to.x, -to.y, -to.z);
        let flags = [
            "-h", "-ab", "0", "-dj", "0", "-ds", "0", "-dt", "0", "-st", "0", "-lr", "0", "-ss",
            "0",
        ];
        let mut arguments = flags.to_vec();
        arguments.push(octree.to_str().unwrap());
        let said = run(&radiance.join("bin/rtrace"), &arguments, &ray);
        let seen: f64 = said.split_whitespace().nth(1).unwrap().parse().unwrap();
        out.push(seen / from.z.abs());
    }
    out
}

fn pairs(count: u64) -> Vec<(DVec3, DVec3)> {
    (0..count)
        .map(|n| {
            let mut random = Stream::new(7, Purpose::Survey, n);
            let mut next = || {
                let (u, v) = (random.uniform(), random.uniform());
                on_hemisphere(0.02 + 0.96 * u, v)
            };
            (next(), next())
        })
        .collect()
}

fn compare(radiance: &Path, xml: &Path, side: Side, count: u64) {
    let file = BsdfFile::read(xml).expect("a good file");
    let ours = Bsdf::Measured(file.reflection(side, None).expect("has the side"));
    let pairs = pairs(count);
    let theirs = traced(radiance, xml, side, &pairs);
    let mut lit = 0;
    let mut off = Vec::new();
    for ((from, to), theirs) in pairs.iter().zip(theirs) {
        // rtrace follows light backwards and asks for f(view, sun), trusting in reciprocity.
        let value = ours.evaluate(*to, *from);
        lit += usize::from(value > 0.0);
        if (value - theirs).abs() > 0.01 * theirs.max(value) + 2e-5 {
            off.push(format!("{from} {to}: {value}, rtrace {theirs}"));
        }
    }
    // On the border of two patches a tiny sun belongs to either.
    assert!(off.len() <= 1 + pairs.len() / 25, "{}: {off:#?}", xml.display());
    assert!(lit * 4 > pairs.len(), "most pairs see light");
}

#[test]
fn values_are_those_that_rtrace_sees() {
    let Some(radiance) = radiance() else { return };
    for (name, side) in [
        (FILES[0], Side::Front),
        (FILES[0], Side::Back),
        (FILES[1], Side::Back),
        (FILES[3], Side::Front),
    ] {
        let Some(path) = support::data(name) else { return };
        compare(&radiance, &path, side, 30);
    }
}

/// A rank-4 tree without any symmetry: a branch whose children are grids of 2 cells an edge, and
/// one that is a single value.
fn rank4() -> String {
    let mut random = Stream::new(3, Purpose::Survey, 0);
    let mut tree = String::from("{");
    for child in 0..16 {
        let count = if child == 5 { 1 } else { 16 };
        tree.push_str("\n{");
        for _ in 0..count {
            write!(tree, " {:.4}", 0.05 + 0.2 * random.uniform()).unwrap();
        }
        tree.push('}');
    }
    tree.push_str("\n}");
    format!(
        "<?xml version=\"1.0\"?>\n<WindowElement xmlns=\"http://windows.lbl.gov\">\n<WindowElementType>System</WindowElementType>\n<FileType>BSDF</FileType>\n<Optical><Layer><Material><Name>n</Name><Manufacturer>m</Manufacturer></Material>\n<DataDefinition><IncidentDataStructure>TensorTree4</IncidentDataStructure></DataDefinition>\n<WavelengthData><LayerNumber>System</LayerNumber><Wavelength unit=\"Integral\">Visible</Wavelength>\n<WavelengthDataBlock><WavelengthDataDirection>Reflection Back</WavelengthDataDirection><AngleBasis>LBNL/Shirley-Chiu</AngleBasis><ScatteringDataType>BRDF</ScatteringDataType><ScatteringData>{tree}</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>\n"
    )
}

#[test]
fn an_anisotropic_tree_is_seen_from_the_same_side_by_rtrace() {
    let Some(radiance) = radiance() else { return };
    let keep = tempfile::tempdir().unwrap();
    let path = keep.path().join("rank4.xml");
    fs::write(&path, rank4()).unwrap();
    compare(&radiance, &path, Side::Front, 60);
}
