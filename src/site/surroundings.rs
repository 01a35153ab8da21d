use glam::{DVec2, DVec3};

use super::draft::{Draft, Full, Shape, Surface};
use super::format::{Axes, Format};
use super::log::Log;
use super::placement::extents;
use super::source::Source;
use super::{Error, Files, Object, Origin, SceneSpec, terrain};
use crate::base::{Place, limits};

/// How far beyond the other files terrain is kept, m: further than light is followed by default.
const SURROUNDINGS_M: f64 = 300.0;
/// Half of the edge of a terrain that stands alone, m: positions are exact enough within.
const ALONE_M: f64 = 90_000.0;

/// Reads the terrains, each cut to the surroundings of everything else.
pub(super) fn terrains(
    files: &Files,
    scene: &SceneSpec,
    formats: &[(Format, Axes)],
    plain: u32,
    sources: &mut [Source],
    draft: &mut Draft,
    log: &mut Log,
) -> Result<(), Error> {
    if !formats.iter().any(|(format, _)| format.is_terrain()) {
        return Ok(());
    }
    let shift = match scene.origin {
        Origin::At(origin) => origin,
        Origin::Auto => DVec3::ZERO,
    };
    let mut known: Option<terrain::Region> = None;
    for (source, extent) in sources.iter().zip(extents(draft, sources.len())) {
        let Some([min, max]) = extent else { continue };
        let shift = if source.is_city { DVec3::ZERO } else { shift };
        let [low, high] = [min, max].map(|p| (p + shift).truncate());
        known = Some(known.map_or([low, high], |[a, b]| [a.min(low), b.max(high)]));
    }
    let region = known.map(|[a, b]| [a - SURROUNDINGS_M, b + SURROUNDINGS_M]);
    for (i, (file, &(format, _))) in scene.files.iter().zip(formats).enumerate() {
        if !format.is_terrain() {
            continue;
        }
        let place = |line| Place { file: file.path.clone(), line, ..Place::default() };
        let bytes = files.scene_file(&file.path)?;
        let read = |region| match format {
            Format::AsciiGrid => terrain::ascii(&bytes, region),
            _ => terrain::geotiff(&bytes, region).map_err(|message| (0, message)),
        };
        let whole = || read(region);
        let grid = match whole() {
            Ok(grid) => grid,
            Err((line, message)) => {
                log.fault(place(line), message);
                continue;
            }
        };
        let grid = match region.is_none().then(|| alone(&grid)).flatten() {
            Some(middle) => match read(Some(middle)) {
                Ok(grid) => grid,
                Err((line, message)) => {
                    log.fault(place(line), message);
                    continue;
                }
            },
            None => grid,
        };
        let corners = terrain::triangles(&grid);
        let [columns, rows] = grid.whole;
        let message = format!(
            "{columns} x {rows} heights, {} x {} around the scene kept; {} triangles within {} m of them",
            grid.layout.columns,
            grid.layout.rows,
            corners.len() / 3,
            terrain::ERROR_M
        );
        log.note(&file.path, message);
        if corners.is_empty() {
            log.fault(
                place(0),
                "no height lies around the other files: do they have the same map coordinates?",
            );
            continue;
        }
        let object = draft.objects.len() as u32;
        let id = file.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        draft.objects.push(Object { id, kind: "terrain".to_owned() });
        let full = |Full| Error::TooManyTriangles { limit: limits::MAX_TRIANGLES };
        let shape: Shape = draft.add_curved(&corners).map_err(full)?;
        let surface =
            Surface { shape, object, material: plain, modifier: None, source: i as u32, line: 0 };
        draft.add_surface(surface).map_err(full)?;
        sources[i].objects = 1;
        sources[i].crs = grid.crs;
    }
    Ok(())
}

/// The middle of a grid that is larger than positions are exact.
fn alone(grid: &terrain::Grid) -> Option<terrain::Region> {
    let l = &grid.layout;
    let corner = |c: usize, r: usize| l.origin + l.axes * DVec2::new(c as f64, r as f64);
    let (last, bottom) = (l.columns.saturating_sub(1), l.rows.saturating_sub(1));
    let corners = [corner(0, 0), corner(last, 0), corner(0, bottom), corner(last, bottom)];
    let low = corners.into_iter().reduce(DVec2::min)?;
    let high = corners.into_iter().reduce(DVec2::max)?;
    let middle = (low + high) * 0.5;
    ((high - low).max_element() > 2.0 * ALONE_M).then_some([middle - ALONE_M, middle + ALONE_M])
}
