//! The query points of a group: plane by plane and piece by piece.
//!
//! Points of one plane share a raster that says where their surface ends; points of one piece of it
//! share the photons that lie there, and neighbours among them one list of candidates.

use super::*;

/// Query points on one piece of a surface, and where their photons are.
struct Piece<'a, A> {
    group: &'a [QueryPoint],
    todo: &'a [Todo],
    reach_m: f32,
    /// The raster, measured for this piece; `None` where the surface ends nowhere.
    mask: Option<&'a Mask>,
    photons: &'a PhotonSet,
    /// Which of the photons lie on the piece; `None`: all do.
    accept: Option<&'a A>,
}

impl<A> Piece<'_, A> {
    fn position(&self, todo: &Todo) -> Vec3 {
        self.group[todo.at as usize].position
    }
}

/// What a list of candidates holds: all photons within `list_m` of a point.
struct Listed {
    centre: Vec3,
    list_m: f32,
    /// Farther than this no photon was loaded.
    longest_m: f32,
}

/// What the query points before lead one to expect of the next.
struct Expected {
    last: Option<Last>,
    radius_m: f32,
}

impl Shared<'_> {
    /// Answers the query points of a group from its photons. `known` tells discs that were found
    /// before.
    pub(super) fn group(
        &self,
        group: &[QueryPoint],
        reach_m: f32,
        scratch: &mut Scratch,
        known: impl Fn(usize) -> Known,
        answer: &mut impl FnMut(usize, Option<Found<'_>>),
    ) {
        let Scratch { loaded, own, candidates, mask, places, sorted, todo, .. } = scratch;
        let level = self.surfaces.is_some() || self.tolerance.plane_m.is_finite();
        sorted.clear();
        sorted.extend(group.iter().enumerate().map(|(i, point)| {
            let offset = (point.normal.dot(point.position) / PLANE_STEP_M).round() as i32;
            let offset_or_piece = if level { offset } else { 0 };
            let normal = point.normal.to_array().map(f32::to_bits);
            Sorted { normal, offset_or_piece, at: i as u32 }
        }));
        sorted.sort_unstable();
        let same =
            |a: &Sorted, b: &Sorted| (a.normal, a.offset_or_piece) == (b.normal, b.offset_or_piece);
        for run in sorted.chunk_by_mut(same) {
            let normal = group[run[0].at as usize].normal;
            let plane = Plane { normal, offset_m: run[0].offset_or_piece as f32 * PLANE_STEP_M };
            let ends = self.surfaces.is_some_and(|surfaces| {
                places.clear();
                places.extend(run.iter().map(|r| group[r.at as usize].position));
                mask.draw(surfaces, plane, self.tolerance, places, (reach_m, reach_m / CELLS))
            });
            if ends {
                // By piece, those without one first.
                for r in run.iter_mut() {
                    let position = group[r.at as usize].position;
                    r.offset_or_piece = mask.component(position).map_or(-1, |c| c as i32);
                }
                run.sort_unstable_by_key(|r| (r.offset_or_piece, r.at));
            }
            for part in run.chunk_by(|a, b| !ends || a.offset_or_piece == b.offset_or_piece) {
                let component = u32::try_from(part[0].offset_or_piece).ok().filter(|_| ends);
                if let Some(component) = component {
                    mask.measure(component);
                }
                let mask = component.map(|_| &*mask);
                let accept = |place: Vec3, n: Vec3| {
                    n.dot(normal) >= self.tolerance.normal_cos
                        && (!level || plane.height_m(place).abs() <= self.tolerance.plane_m)
                        && component.is_none_or(|c| mask.is_none_or(|m| m.holds(c, place)))
                };
                todo.clear();
                todo.extend(part.iter().filter_map(|r| match known(r.at as usize) {
                    Known::Elsewhere => None,
                    Known::Disc(disc) => Some(Todo { at: r.at, known: Some(disc) }),
                    Known::Nothing => Some(Todo { at: r.at, known: None }),
                }));
                // Many pixels on one plane are worth photons of their own; few sort out what they
                // find among all.
                let worth = todo.len() * self.gather.bandwidth >= loaded.len();
                let whole = !level && loaded.normals().iter().all(|n| accept(Vec3::ZERO, *n));
                let (photons, accept) = if whole {
                    (&*loaded, None)
                } else if worth {
                    own.take(loaded, accept);
                    (&*own, None)
                } else {
                    (&*loaded, Some(&accept))
                };
                let piece = Piece { group, todo, reach_m, mask, photons, accept };
                self.piece(&piece, candidates, answer);
            }
        }
    }

    /// Answers the query points of a piece, neighbours from one list of candidates.
    fn piece<A: Fn(Vec3, Vec3) -> bool>(
        &self,
        piece: &Piece<'_, A>,
        candidates: &mut Candidates,
        answer: &mut impl FnMut(usize, Option<Found<'_>>),
    ) {
        let photons = piece.photons;
        let mut expected = Expected { last: None, radius_m: piece.reach_m / AHEAD };
        let mut rest = piece.todo;
        while let Some(first) = rest.first() {
            let known_m = |disc: &Disc| disc.bound.distance2_m2.sqrt();
            let radius_m = first.known.as_ref().map_or(expected.radius_m, known_m);
            let mut bounds = Aabb::around([piece.position(first)]);
            let alike = rest.iter().take_while(|next| {
                let grown = bounds.union(Aabb::around([piece.position(next)]));
                let near = 0.5 * grown.size().length() <= SPREAD * radius_m;
                bounds = if near { grown } else { bounds };
                near
            });
            let length = alike.count().max(1);
            let (cluster, others) = rest.split_at(length);
            rest = others;
            let spread_m = 0.5 * bounds.size().length();
            let longest_m = (piece.reach_m + spread_m) * 1.0001 + 1e-6;
            let list_m = ((1.0 + SPARE) * radius_m + spread_m).min(longest_m);
            let mut listed = Listed { centre: bounds.center(), list_m, longest_m };
            candidates.list(photons, listed.centre, listed.list_m, piece.accept);
            for todo in cluster {
                let disc = self.disc_of(piece, todo, candidates, &mut listed, &mut expected);
                let found = disc.map(|disc| Found { disc, loaded: photons, candidates });
                answer(todo.at as usize, found);
            }
        }
    }

    /// The disc of a query point; the list of candidates is made longer until it holds it. `None`
    /// where photons would have to be loaded from farther away.
    fn disc_of<A: Fn(Vec3, Vec3) -> bool>(
        &self,
        piece: &Piece<'_, A>,
        todo: &Todo,
        candidates: &mut Candidates,
        listed: &mut Listed,
        expected: &mut Expected,
    ) -> Option<Disc> {
        let reach_m = piece.reach_m;
        let wanted = Wanted {
            count: self.gather.bandwidth,
            estimator: self.gather.estimator,
            reach_m,
            last_word: reach_m >= self.max_radius_m,
        };
        let point = piece.position(todo);
        loop {
            if let Some(disc) = todo.known {
                // Beyond the longest list nothing lies.
                if listed.list_m >= listed.longest_m || candidates.holds(point, disc.bound) {
                    candidates.look(point);
                    return Some(disc);
                }
            } else {
                match candidates.bound(piece.photons, point, &wanted, expected.last) {
                    Answer::Bound(bound) => {
                        let radius_m = bound.distance2_m2.sqrt();
                        expected.last = bound.full.then_some(Last { point, radius_m });
                        expected.radius_m = radius_m.max(reach_m / 64.0);
                        let kernel = self.gather.kernel;
                        let share = |r| piece.mask.map_or(1.0, |m| m.share(point, r, kernel));
                        return Some(self.disc(bound, share));
                    }
                    Answer::LoadMore => return None,
                    Answer::ListMore => {}
                }
            }
            listed.list_m = (listed.list_m * LONGER).min(listed.longest_m);
            candidates.list(piece.photons, listed.centre, listed.list_m, piece.accept);
        }
    }
}
