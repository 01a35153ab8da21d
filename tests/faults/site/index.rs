//! Every scene and terrain of the folder of real data.

use super::*;

/// Files that INDEX.md's table names, with `*` and side forms (`, .city.jsonl`) written out.
fn listed(index: &str, folder: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    for row in index.lines().filter_map(|l| l.strip_prefix("| ")) {
        let names = row.split(" |").next().unwrap_or_default();
        let mut first = "";
        for name in names.split(", ") {
            let name = match name.strip_prefix('.') {
                Some(end) => format!("{}.{end}", first.split('.').next().unwrap_or_default()),
                None => name.to_owned(),
            };
            first = names.split(", ").next().unwrap_or_default();
            let (parent, last) = name.rsplit_once('/').unwrap_or(("", &name));
            let (start, end) = last.split_once('*').unwrap_or((last, ""));
            let Ok(entries) = fs::read_dir(folder.join(parent)) else { continue };
            out.extend(entries.map(|e| e.unwrap().path()).filter(|p| {
                let name = p.file_name().unwrap().to_string_lossy();
                if last.contains('*') {
                    name.starts_with(start) && name.ends_with(end)
                } else {
                    name == last
                }
            }));
        }
    }
    out
}

#[test]
fn all_scenes_and_terrains_of_the_index_are_read() {
    let Some(index) = support::data("INDEX.md") else { return };
    let folder = index.parent().unwrap();
    let known = listed(&fs::read_to_string(&index).unwrap(), folder);
    let mut read = 0;
    for sub in ["city", "terrain", "terrain/geotags"] {
        for entry in fs::read_dir(folder.join(sub)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                continue;
            }
            assert!(known.contains(&path), "{} isn't in INDEX.md", path.display());
            let loaded = load(&SceneSpec::of([&path]), &[]);
            let loaded = loaded.unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let site = &loaded.site;
            assert!(site.triangles.iter().all(|t| t.corners.iter().all(|c| c.is_finite())));
            eprintln!("{}: {} triangles", path.display(), site.triangles.len());
            read += 1;
        }
    }
    assert_eq!(read, 10);
    // Data of other kinds is no scene, and says so.
    for path in known.iter().filter(|p| !p.starts_with(folder.join("city"))) {
        if path.starts_with(folder.join("terrain")) {
            continue;
        }
        let error = load(&SceneSpec::of([path]), &[]).expect_err("no scene").to_string();
        assert!(error.contains("can't tell the format"), "{error}");
    }
}
