//! Materials of Radiance as far as we need them: a diffuse reflectance, and whether rays pass.

use crate::site::Material;

/// What a primitive type is to us.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// Has geometry.
    Surface,
    /// Has geometry that lies in another file.
    Nested,
    /// Scatters light.
    Material,
    /// Changes a material.
    Pattern,
    /// Mixes two modifiers.
    Mixture,
    /// Its surfaces are no obstacles.
    Invisible,
    /// Nothing that Radiance knows.
    Unknown,
}

/// Types of the reference manual by what they are to us.
const TYPES: [(Class, &str); 6] = [
    (Class::Surface, "polygon sphere bubble cylinder tube cone cup ring source"),
    (Class::Nested, "instance mesh"),
    (
        Class::Material,
        "plastic metal trans mirror glass dielectric interface light glow spotlight illum \
    plastic2 metal2 trans2 ashik2 prism1 prism2 plasfunc metfunc transfunc plasdata metdata \
    transdata BRTDfunc BSDF aBSDF WGMDfunc ashikhmin directfunc",
    ),
    (
        Class::Pattern,
        "texfunc texdata colorfunc colordata colorpict brightfunc brightdata brighttext colortext \
    spectrum specfile specfunc specdata specpict",
    ),
    (Class::Mixture, "mixfunc mixdata mixpict mixtext"),
    (Class::Invisible, "antimatter mist"),
];

/// What a primitive type is to us.
pub(super) fn classify(kind: &str) -> Class {
    let known = TYPES.iter().find(|(_, names)| names.split(' ').any(|name| name == kind));
    known.map_or(Class::Unknown, |&(class, _)| class)
}

/// A surface type that a misspelt one may mean.
pub(super) fn nearest_surface(kind: &str) -> Option<&'static str> {
    let mut surfaces = TYPES[..2].iter().flat_map(|(_, names)| names.split(' '));
    surfaces.find(|name| strsim::damerau_levenshtein(kind, name) <= 2)
}

/// What was made of a material definition.
#[derive(Debug, PartialEq)]
pub(super) struct Made {
    pub material: Material,
    /// What isn't followed, said once where a surface uses it.
    pub caveat: Option<String>,
}

/// Turns a material's real arguments into reflectances, after the manual's argument lists;
/// the message of a fault where there are too few or too many.
pub(super) fn material(
    kind: &str,
    name: &str,
    reals: &[f64],
    default_reflectance: f64,
) -> Result<Made, String> {
    let takes = |counts: &[usize], what: &str| {
        if counts.contains(&reals.len()) {
            return Ok(());
        }
        let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
        Err(format!("{kind} needs {} numbers ({what}), found {}", counts.join(" or "), reals.len()))
    };
    // Reflectance per channel, and whether any of it is diffuse.
    let (reflectance, diffuse, caveat) = match kind {
        "plastic" => {
            takes(&[5], "red, green, blue, specularity, roughness")?;
            (scaled(reals, 1.0 - reals[3]), true, None)
        }
        "metal" => {
            takes(&[5], "red, green, blue, specularity, roughness")?;
            (scaled(reals, 1.0), reals[3] < 1.0, None)
        }
        "trans" => {
            takes(
                &[7],
                "red, green, blue, specularity, roughness, transmission, its specular part",
            )?;
            let caveat = "trans: taken as opaque, its transmission isn't followed".to_owned();
            (scaled(reals, (1.0 - reals[3]) * (1.0 - reals[5])), true, Some(caveat))
        }
        "plastic2" | "metal2" if reals.len() >= 4 => {
            (scaled(reals, if kind == "plastic2" { 1.0 - reals[3] } else { 1.0 }), true, None)
        }
        "mirror" => {
            takes(&[3], "red, green, blue")?;
            (scaled(reals, 1.0), false, None)
        }
        "glass" => {
            takes(&[3, 4], "transmissivity in red, green, blue, and the index")?;
            (normal_incidence(2.0, reals.get(3).copied().unwrap_or(1.52)), false, None)
        }
        "dielectric" => {
            takes(&[5], "red, green, blue, index, Hartmann's constant")?;
            (normal_incidence(1.0, reals[3]), false, None)
        }
        "interface" => {
            takes(&[8], "red, green, blue, index inside, then outside")?;
            (normal_incidence(1.0, reals[3] / reals[7]), false, None)
        }
        // What they are is said by `measured`.
        "BSDF" | "aBSDF" => ([default_reflectance; 3], true, None),
        "light" | "glow" | "spotlight" => {
            takes(
                match kind {
                    "light" => &[3],
                    "glow" => &[4],
                    _ => &[7],
                },
                "red, green, blue, …",
            )?;
            let caveat = format!("{kind}: taken as a black surface, only the PV sends light");
            ([0.0; 3], false, Some(caveat))
        }
        _ => {
            let caveat = format!(
                "material type `{kind}` isn't followed; taken as diffuse with the default reflectance {default_reflectance}"
            );
            ([default_reflectance; 3], true, Some(caveat))
        }
    };
    let off = reflectance.iter().find(|v| !(0.0..=1.0).contains(*v));
    let caveat = match off {
        Some(v) => Some(format!("{kind}: reflectance {v} is held within 0 and 1")),
        None => caveat,
    };
    let reflectance = reflectance.map(|v| v.clamp(0.0, 1.0) as f32);
    Ok(Made { material: Material { name: name.to_owned(), reflectance, diffuse }, caveat })
}

/// What isn't followed of a scene surface with a measured BSDF, after the manual's lists of
/// strings: `BSDF` thickness file up-x up-y up-z function transform, `aBSDF` the same without
/// thickness.
pub(super) fn measured(kind: &str, strings: &[&str], default_reflectance: f64) -> Option<String> {
    let (thickness, rest) = match (kind, strings) {
        ("BSDF", [thickness, rest @ ..]) => (*thickness, rest),
        ("aBSDF", rest) => ("0", rest),
        ("BSDF", _) => ("0", &[][..]),
        _ => return None,
    };
    let file = rest.first().copied().unwrap_or("?");
    let up = rest.get(1..4).map_or_else(String::new, |up| format!(", up {}", up.join(" ")));
    let proxy = match thickness.parse::<f64>() {
        Ok(0.0) => String::new(),
        _ => format!(", thickness {thickness} (the geometry that it stands for isn't looked for)"),
    };
    Some(format!(
        "{kind} from `{file}`{up}{proxy}: surfaces of the scene aren't scattered by it; taken as diffuse with the default reflectance {default_reflectance}. For PV name the file under [[material]] bsdf"
    ))
}

fn scaled(reals: &[f64], by: f64) -> [f64; 3] {
    [reals[0] * by, reals[1] * by, reals[2] * by]
}

/// Fresnel's reflectance at normal incidence of `faces` faces.
fn normal_incidence(faces: f64, index: f64) -> [f64; 3] {
    let amplitude = (index - 1.0) / (index + 1.0);
    let value = faces * amplitude * amplitude;
    [if value.is_finite() { value.min(1.0) } else { 1.0 }; 3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectances_follow_the_manual() {
        let of = |kind, reals: &[f64]| material(kind, "m", reals, 0.3).unwrap();
        let plastic = of("plastic", &[0.5, 0.4, 0.2, 0.5, 0.1]);
        assert_eq!(plastic.material.reflectance, [0.25, 0.2, 0.1]);
        assert!(plastic.material.diffuse && plastic.caveat.is_none());
        assert_eq!(of("metal", &[0.5, 0.4, 0.2, 1.0, 0.0]).material.reflectance, [0.5, 0.4, 0.2]);
        assert!(!of("mirror", &[0.9, 0.9, 0.9]).material.diffuse);
        assert!((of("glass", &[0.9; 3]).material.reflectance[0] - 0.0852).abs() < 1e-3);
        let unknown = of("ashik2", &[]);
        assert_eq!(unknown.material.reflectance, [0.3; 3]);
        assert!(unknown.caveat.unwrap().contains("ashik2"));
        assert!(of("plastic", &[1.5, 0.0, 0.0, 0.0, 0.0]).caveat.unwrap().contains("1.5"));
        let few = material("plastic", "m", &[0.5, 0.5, 0.5], 0.3).unwrap_err();
        assert!(few.contains("5 numbers") && few.contains("found 3"), "{few}");
    }

    #[test]
    fn measured_files_are_named() {
        let strings = ["0", "blind.xml", "0", "0", "1", "."];
        let said = measured("BSDF", &strings, 0.3).unwrap();
        assert!(said.contains("`blind.xml`, up 0 0 1:") && said.contains("0.3"), "{said}");
        let said = measured("BSDF", &["0.1", "blind.xml", "0", "0", "1", "."], 0.3).unwrap();
        assert!(said.contains("thickness 0.1"), "{said}");
        assert!(measured("aBSDF", &strings[1..], 0.3).unwrap().contains("`blind.xml`, up 0 0 1"));
        assert!(measured("BSDF", &[], 0.3).is_some() && measured("plastic", &[], 0.3).is_none());
        let interface = material("interface", "m", &[1.0, 1.0, 1.0, 1.5, 1.0, 1.0, 1.0, 1.33], 0.3);
        assert!((interface.unwrap().material.reflectance[0] - 0.0036).abs() < 1e-4);
    }

    #[test]
    fn misspelt_surfaces_are_recognised() {
        assert_eq!(nearest_surface("polgyon"), Some("polygon"));
        assert_eq!(nearest_surface("velvet"), None);
    }
}
