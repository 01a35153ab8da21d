//! The outline of each region, around the pixels that show it: what hides it hides its outline.

use std::collections::BTreeSet;

use crate::picture::figure::Polyline;
use crate::project::PlannedView;
use crate::project::RegionTable;
use crate::receivers::points::{Spreader, holds};
use crate::render::{Hit, HitKind, HitMap};
use crate::run::error::Error;
use crate::run::job::Job;

const OUTLINE: [u8; 3] = [120, 226, 255];

/// The outlines of all regions in a view.
pub(super) fn outlines(job: &Job<'_>, planned: &PlannedView) -> Result<Vec<Polyline>, Error> {
    let regions = &job.resolved.project.region;
    if regions.is_empty() {
        return Ok(Vec::new());
    }
    let spreader = Spreader { resolved: job.resolved, site: job.site()? };
    let hits = job.folder.read_hits(&planned.name)?;
    let mut out = Vec::new();
    for region in regions {
        let shown = shown(&spreader, region, planned, &hits)?;
        let points = around(&shown, hits.columns);
        if !points.is_empty() {
            out.push(Polyline { points, color: OUTLINE, width: 0.7, label: String::new() });
        }
    }
    Ok(out)
}

/// Which pixels show a region.
fn shown(
    spreader: &Spreader<'_>,
    region: &RegionTable,
    planned: &PlannedView,
    hits: &HitMap,
) -> Result<Vec<bool>, Error> {
    let solid = |hit: &Hit| !matches!(hit.kind, HitKind::Sky | HitKind::Clipped);
    if let (Some(view), Some(polygon)) = (&region.view, &region.polygon) {
        let here = *view == planned.name;
        let middle =
            |at: usize| ((at % hits.columns) as f64 + 0.5, (at / hits.columns) as f64 + 0.5);
        let inside = |at: usize| holds(polygon, middle(at).0, middle(at).1);
        return Ok((0..hits.hits.len()).map(|at| here && inside(at)).collect());
    }
    if let Some(polygon) = spreader.plan(region) {
        let inside = |hit: &Hit| {
            let at = hit.position.as_dvec3();
            solid(hit) && holds(&polygon, at.x, at.y)
        };
        return Ok(hits.hits.iter().map(inside).collect());
    }
    let objects: BTreeSet<u32> = spreader.objects(region)?.into_iter().collect();
    Ok(hits.hits.iter().map(|hit| solid(hit) && objects.contains(&hit.object)).collect())
}

/// The border of the pixels that are set, in pixels from the upper left corner; the rim of the
/// picture is none. Pieces are apart by a point that isn't finite.
fn around(set: &[bool], columns: usize) -> Vec<[f64; 2]> {
    let rows = set.len() / columns.max(1);
    let mut out = Vec::new();
    let mut piece = |a: [usize; 2], b: [usize; 2]| {
        out.extend([a.map(|v| v as f64), b.map(|v| v as f64), [f64::NAN; 2]]);
    };
    let differ =
        |a: [usize; 2], b: [usize; 2]| set[a[1] * columns + a[0]] != set[b[1] * columns + b[0]];
    for column in 1..columns {
        let edge = |row: usize| row < rows && differ([column - 1, row], [column, row]);
        let starts = (0..rows).filter(|&row| edge(row) && (row == 0 || !edge(row - 1)));
        for row in starts {
            let end = (row..=rows).find(|&row| !edge(row)).unwrap_or(rows);
            piece([column, row], [column, end]);
        }
    }
    for row in 1..rows {
        let edge = |column: usize| column < columns && differ([column, row - 1], [column, row]);
        let starts = (0..columns).filter(|&c| edge(c) && (c == 0 || !edge(c - 1)));
        for column in starts {
            let end = (column..=columns).find(|&c| !edge(c)).unwrap_or(columns);
            piece([column, row], [end, row]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::around;

    #[test]
    fn borders_run_around_what_is_set_but_not_along_the_rim() {
        // A block of two by two in the corner, and a pixel by itself.
        let picture = ["##...", "##...", "...#.", "....."];
        let set: Vec<bool> =
            picture.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        let points = around(&set, 5);
        let mut pieces: Vec<[f64; 4]> =
            points.chunks(3).map(|p| [p[0][0], p[0][1], p[1][0], p[1][1]]).collect();
        assert!(points.chunks(3).all(|p| p[2][0].is_nan()));
        pieces.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
        let expected = [
            [0.0, 2.0, 2.0, 2.0],
            [2.0, 0.0, 2.0, 2.0],
            [3.0, 2.0, 3.0, 3.0],
            [3.0, 2.0, 4.0, 2.0],
            [3.0, 3.0, 4.0, 3.0],
            [4.0, 2.0, 4.0, 3.0],
        ];
        assert_eq!(pieces, expected);
        assert!(around(&[true; 6], 3).is_empty());
        assert!(around(&[], 0).is_empty());
    }
}
