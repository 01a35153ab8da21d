//! What a modifier's name means at a place of a Radiance scene.
//!
//! Radiance resolves names by order: a definition holds until the next one of its name, over all
//! files. Surfaces may stand before their material when a later file defines it, so unknown names
//! wait until the end.

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::base::Place;
use crate::site::Material;
use crate::site::draft::Draft;
use crate::site::log::Log;

/// What surfaces of a modifier are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Of this material, an index into the draft's.
    Material(u32),
    /// Rays pass: `void`, `antimatter`, `mist`.
    Nothing,
}

struct Definition {
    target: Target,
    place: Place,
    /// What isn't followed; said where the first surface uses it.
    caveat: Option<String>,
}

/// The names of modifiers over all Radiance files of a scene, in order: a definition holds from
/// where it stands, in its file and those after it.
pub(in crate::site) struct Names {
    latest: HashMap<String, usize>,
    definitions: Vec<Definition>,
    /// Index into the draft's modifiers.
    numbers: HashMap<String, u32>,
    /// Surfaces whose modifier wasn't defined where they stand, by its name.
    waiting: BTreeMap<String, (Place, Vec<usize>)>,
    /// Modifiers that `[[pv]]` selects: whatever the scene says about them doesn't matter.
    pv: HashSet<String>,
    default_reflectance: f64,
}

impl Names {
    /// No definitions yet. `pv`: the names that `[[pv]]` entries select.
    pub fn new(default_reflectance: f64, pv: impl IntoIterator<Item = String>) -> Self {
        Self {
            latest: HashMap::new(),
            definitions: Vec::new(),
            numbers: HashMap::new(),
            waiting: BTreeMap::new(),
            pv: pv.into_iter().collect(),
            default_reflectance,
        }
    }

    pub(super) fn default_reflectance(&self) -> f64 {
        self.default_reflectance
    }

    pub(super) fn define(
        &mut self,
        name: &str,
        target: Target,
        place: Place,
        caveat: Option<String>,
    ) {
        self.latest.insert(name.to_owned(), self.definitions.len());
        self.definitions.push(Definition { target, place, caveat });
    }

    /// Adds a material to the draft and defines it.
    pub(super) fn define_material(
        &mut self,
        draft: &mut Draft,
        material: Material,
        place: Place,
        caveat: Option<String>,
    ) {
        let name = material.name.clone();
        let target = Target::Material(draft.materials.len() as u32);
        draft.materials.push(material);
        self.define(&name, target, place, caveat);
    }

    /// A material of this name that nothing is known about.
    pub(super) fn plain(&self, name: &str) -> Material {
        Material {
            name: name.to_owned(),
            reflectance: [self.default_reflectance as f32; 3],
            diffuse: true,
        }
    }

    /// What a modifier stands for here.
    pub(super) fn find(&self, name: &str) -> Option<Target> {
        if name == "void" {
            return Some(Target::Nothing);
        }
        self.latest.get(name).map(|&i| self.definitions[i].target)
    }

    /// Index of a modifier's name among the draft's.
    pub(super) fn number(&mut self, draft: &mut Draft, name: &str) -> u32 {
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        let number = draft.modifiers.len() as u32;
        draft.modifiers.push(name.to_owned());
        self.numbers.insert(name.to_owned(), number);
        number
    }

    /// Says once what isn't followed about a modifier that a surface uses.
    pub(super) fn warn_once(&mut self, name: &str, log: &mut Log) {
        let Some(&i) = self.latest.get(name) else { return };
        let definition = &mut self.definitions[i];
        if let Some(caveat) = definition.caveat.take()
            && !self.pv.contains(name)
        {
            log.warn("materials that aren't followed", definition.place.clone(), caveat);
        }
    }

    /// Remembers a surface whose modifier isn't defined yet.
    pub(super) fn wait(&mut self, name: &str, place: Place, surface: usize) {
        self.waiting.entry(name.to_owned()).or_insert((place, Vec::new())).1.push(surface);
    }

    /// Gives waiting surfaces their material: a later definition, or the default.
    pub fn finish(mut self, draft: &mut Draft, log: &mut Log) {
        let mut gone = HashSet::new();
        for (name, (place, surfaces)) in std::mem::take(&mut self.waiting) {
            let later = self.latest.get(&name).map(|&i| &self.definitions[i]);
            if !self.pv.contains(&name) {
                let message = match later {
                    Some(d) => format!(
                        "modifier `{name}` is defined only later, at {}; taken from there (Radiance refuses this)",
                        d.place
                    ),
                    None => format!(
                        "modifier `{name}` is defined nowhere; its {} surfaces are taken as diffuse with the default reflectance {}",
                        surfaces.len(),
                        self.default_reflectance
                    ),
                };
                log.warn("modifiers without a definition before them", place, message);
            }
            match later.map(|d| d.target) {
                Some(Target::Material(material)) => {
                    for &i in &surfaces {
                        draft.surfaces[i].material = material;
                    }
                }
                Some(Target::Nothing) => gone.extend(surfaces),
                None => {
                    let material = draft.materials.len() as u32;
                    draft.materials.push(self.plain(&name));
                    for &i in &surfaces {
                        draft.surfaces[i].material = material;
                    }
                }
            }
        }
        if !gone.is_empty() {
            let mut i = 0;
            draft.surfaces.retain(|_| {
                i += 1;
                !gone.contains(&(i - 1))
            });
        }
    }
}
