//! The plan of the house as `tools tidy` holds it: who may know whom, where outside crates live,
//! and which files may still import each other in a circle.

/// A unit of the house, a room or a wing of one, and the units it may use.
///
/// `"render"` in the second place stands for all of that room, wings included. A file that lies in
/// a room but in none of its wings (`src/glare/session.rs`) belongs to the room itself.
pub const UNITS: &[(&str, &[&str])] = &[
    ("base", &[]),
    ("bsdf", &["base"]),
    ("sky", &["base"]),
    ("site", &["base", "bsdf"]),
    ("trace", &["base", "bsdf", "site", "sky"]),
    ("pages", &["base", "formats"]),
    ("render", &["base", "bsdf", "formats", "site", "sky", "pages"]),
    ("render/view", &["base", "formats", "site"]),
    ("render/gather", &["base", "site", "pages", "render/view"]),
    ("render/reflect", &["base", "bsdf", "site", "sky", "render/view"]),
    ("render/paint", &["base", "bsdf", "site", "sky", "render/view", "render/reflect"]),
    ("volume", &["base", "formats"]),
    ("glare", &["base", "volume"]),
    ("glare/filter", &["base", "volume"]),
    ("glare/events", &["base", "volume", "glare/filter"]),
    ("glare/year", &["base", "volume", "glare/filter"]),
    ("rules", &["base"]),
    ("picture", &["base", "formats"]),
    ("project", &["base", "formats", "bsdf", "site", "sky", "trace", "render", "glare", "rules"]),
    (
        "receivers",
        &["base", "project", "bsdf", "site", "sky", "pages", "render", "volume", "glare", "rules"],
    ),
    ("report", &["base", "project", "receivers", "glare", "rules", "volume", "picture"]),
    (
        "run",
        &[
            "base",
            "formats",
            "bsdf",
            "site",
            "sky",
            "trace",
            "pages",
            "render",
            "volume",
            "glare",
            "rules",
            "picture",
            "project",
            "receivers",
            "report",
        ],
    ),
    (
        "cli",
        &[
            "base",
            "formats",
            "bsdf",
            "site",
            "sky",
            "trace",
            "pages",
            "render",
            "volume",
            "glare",
            "rules",
            "picture",
            "project",
            "receivers",
            "report",
            "run",
        ],
    ),
];

/// An outside crate and the files or folders in which it may be named.
pub const HOMES: &[(&str, &[&str])] = &[
    ("obvhs", &["src/site/bvh.rs"]),
    ("memmap2", &["src/pages/mapped.rs"]),
    ("exr", &["src/picture/exr.rs"]),
    ("clap", &["src/cli/", "src/main.rs", "tools/"]),
    ("bincode", &["formats/src/gmp"]),
];

/// The rooms that know the files of a run, and where alone those are named.
pub const ARTIFACTS: (&[&str], &str) =
    (&["project", "receivers", "report", "run"], "project/artifacts");

/// How the names of files of a run end, and of the channels in them.
pub const ENDINGS: &[&str] = &[
    ".csv", ".exr", ".geojson", ".gmh", ".gmp", ".hdr", ".html", ".json", ".jsonl", ".notes",
    ".npy", ".png", ".zarr", ".wh_m2", ".w_m2", ".cd_m2", ".h",
];

/// Files that import each other and may: parent and child of one thing. The list only shrinks: a
/// circle that isn't listed is refused, and so is an entry that is no circle any more.
pub const CIRCLES: &[&[&str]] = &[
    // The BSDF of several BSDFs side by side.
    &["bsdf/mixture.rs", "bsdf/scatter.rs"],
    // A part of a mixture may be named as a preset.
    &["bsdf/model.rs", "bsdf/presets.rs"],
    &["bsdf/tree.rs", "bsdf/tree/build.rs"],
    // A lobe is integrated by a kernel that scatters along it.
    &["render/reflect/direct/kernel.rs", "render/reflect/direct/lobe.rs"],
    // A year of the mirror rule is made of what the rule finds lit.
    &["render/reflect/mirror/rule.rs", "render/reflect/mirror/year.rs"],
    // A scene holds the crowns that are made of its faces.
    &["site/crowns.rs", "site/scene.rs"],
];
