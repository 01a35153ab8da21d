//! The spots of a group: plane by plane and component by component.

use super::*;

impl Shared<'_> {
    /// Answers the spots of a group from its photons, plane by plane. `known` tells discs that
    /// were found before (and spots that are none of this group's).
    pub(super) fn group(
        &self,
        group: &[QueryPoint],
        reach_m: f32,
        scratch: &mut Scratch,
        known: impl Fn(usize) -> Option<Option<Disc>>,
        answer: &mut impl FnMut(usize, Option<Found<'_>>),
    ) {
        let Scratch { loaded, own, candidates, mask, places, keyed, todo, .. } = scratch;
        keyed.clear();
        let level = self.surfaces.is_some() || self.tolerance.plane_m.is_finite();
        for (i, spot) in group.iter().enumerate() {
            let offset = (spot.normal.dot(spot.position) / PLANE_STEP_M).round() as i32;
            let offset = if level { offset } else { 0 };
            keyed.push((spot.normal.to_array().map(f32::to_bits), offset, i as u32));
        }
        keyed.sort_unstable();
        for run in keyed.chunk_by_mut(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let normal = group[run[0].2 as usize].normal;
            let plane = Plane { normal, offset_m: run[0].1 as f32 * PLANE_STEP_M };
            let ends = self.surfaces.is_some_and(|surfaces| {
                places.clear();
                places.extend(run.iter().map(|r| group[r.2 as usize].position));
                mask.draw(surfaces, plane, self.tolerance, places, (reach_m, reach_m / CELLS))
            });
            if ends {
                // By component, those without one first.
                for r in run.iter_mut() {
                    let place = group[r.2 as usize].position;
                    r.1 = mask.component(place).map_or(-1, |c| c as i32);
                }
                run.sort_unstable_by_key(|r| (r.1, r.2));
            }
            for part in run.chunk_by(|a, b| !ends || a.1 == b.1) {
                let component = (ends && part[0].1 >= 0).then_some(part[0].1 as u32);
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
                for &(_, _, at) in part {
                    match known(at as usize) {
                        Some(None) => {}
                        Some(disc) => todo.push((at, disc)),
                        None => todo.push((at, None)),
                    }
                }
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
                self.spots(group, todo, (reach_m, mask, accept), (photons, candidates), answer);
            }
        }
    }

    /// Answers spots of one plane and component, neighbours from one list of candidates.
    fn spots(
        &self,
        group: &[QueryPoint],
        todo: &[(u32, Option<Disc>)],
        (reach_m, mask, accept): (f32, Option<&Mask>, Option<&impl Fn(Vec3, Vec3) -> bool>),
        (loaded, candidates): (&PhotonSet, &mut Candidates),
        answer: &mut impl FnMut(usize, Option<Found<'_>>),
    ) {
        let (count, estimator) = (self.gather.bandwidth, self.gather.estimator);
        let last_word = reach_m >= self.max_radius_m;
        let wanted = Wanted { count, estimator, reach_m, last_word };
        let place = |(at, _): (u32, Option<Disc>)| group[at as usize].position;
        let known_m = |disc: &Disc| disc.bound.distance2_m2.sqrt();
        let mut last: Option<Last> = None;
        let mut guess_m = reach_m / AHEAD;
        let mut rest = todo;
        while let Some(&first) = rest.first() {
            let radius_m = first.1.as_ref().map_or(guess_m, known_m);
            let mut bounds = Aabb::around([place(first)]);
            let alike = rest.iter().take_while(|next| {
                let grown = bounds.union(Aabb::around([place(**next)]));
                let near = 0.5 * grown.size().length() <= SPREAD * radius_m;
                bounds = if near { grown } else { bounds };
                near
            });
            let length = alike.count().max(1);
            let (cluster, others) = rest.split_at(length);
            rest = others;
            let centre = bounds.center();
            let spread_m = 0.5 * bounds.size().length();
            let longest_m = (reach_m + spread_m) * 1.0001 + 1e-6;
            let mut list_m = ((1.0 + SPARE) * radius_m + spread_m).min(longest_m);
            candidates.list(loaded, centre, list_m, accept);
            for &(at, known) in cluster {
                let point = group[at as usize].position;
                let disc = loop {
                    let bound = match known {
                        Some(disc) if candidates.holds(point, disc.bound) => {
                            candidates.look(point);
                            break Some(disc);
                        }
                        // Nothing lies beyond.
                        Some(disc) if list_m >= longest_m => {
                            candidates.look(point);
                            break Some(disc);
                        }
                        Some(_) => Answer::ListMore,
                        None => candidates.bound(loaded, point, &wanted, last),
                    };
                    match bound {
                        Answer::Bound(bound) => {
                            let exact_m = bound.distance2_m2.sqrt();
                            last = bound.full.then_some(Last { point, radius_m: exact_m });
                            guess_m = exact_m.max(reach_m / 64.0);
                            let kernel = self.gather.kernel;
                            let share = |r| mask.map_or(1.0, |m: &Mask| m.share(point, r, kernel));
                            break Some(self.disc(bound, share));
                        }
                        Answer::LoadMore => break None,
                        Answer::ListMore => {
                            list_m = (list_m * LONGER).min(longest_m);
                            candidates.list(loaded, centre, list_m, accept);
                        }
                    }
                };
                answer(at as usize, disc.map(|disc| Found { disc, loaded, candidates }));
            }
        }
    }
}
