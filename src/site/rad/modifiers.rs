use super::materials::{self, Class};
use super::names::Target;
use super::read::{Primitive, Reader, Stop};
use crate::base::Place;

/// Aliases, materials, patterns: what modifiers stand for.
impl Reader<'_, '_, '_> {
    pub fn alias(&mut self, modifier: &str, name: &str, target: &str, place: Place) {
        match self.names.find(target) {
            Some(found) => {
                let unfollowed = modifier != "void" && modifier != "inherit";
                let caveat = unfollowed.then(|| {
                    format!("alias `{name}`: what `{modifier}` does to `{target}` isn't followed")
                });
                self.names.define(name, found, place, caveat);
            }
            None => {
                let caveat = format!(
                    "alias `{name}`: `{target}` isn't defined before it; taken as diffuse with the default reflectance"
                );
                let plain = self.names.plain(name);
                self.names.define_material(self.draft, plain, place, Some(caveat));
            }
        }
    }

    pub fn take(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        match materials::classify(p.kind) {
            Class::Surface => self.surface(p),
            Class::Nested => self.nested(p),
            Class::Material | Class::Unknown => self.material(p),
            Class::Pattern => {
                self.pattern(p);
                Ok(())
            }
            Class::Mixture => {
                let caveat = format!(
                    "{} `{}` isn't followed; taken as diffuse with the default reflectance",
                    p.kind, p.name
                );
                let plain = self.names.plain(p.name);
                self.names.define_material(self.draft, plain, self.place(p), Some(caveat));
                Ok(())
            }
            Class::Invisible => {
                self.names.define(p.name, Target::Nothing, self.place(p), None);
                Ok(())
            }
        }
    }

    fn material(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        if p.kind == "illum" {
            self.illum(p);
            return Ok(());
        }
        let default = self.names.default_reflectance();
        let made = materials::material(p.kind, p.name, &p.reals, default);
        let made = made.map_err(|message| self.fault(self.place(p), message))?;
        let mut caveat = made.caveat.or_else(|| materials::measured(p.kind, &p.strings, default));
        if p.modifier != "void" && caveat.is_none() {
            caveat = Some(format!(
                "what `{}` does to the material `{}` isn't followed",
                p.modifier, p.name
            ));
        }
        self.names.define_material(self.draft, made.material, self.place(p), caveat);
        Ok(())
    }

    /// `illum`: seen as its other material, or not at all. It sends no light here.
    fn illum(&mut self, p: &Primitive<'_>) {
        let other = p.strings.first().copied().unwrap_or("void");
        let target = self.names.find(other).unwrap_or(Target::Nothing);
        self.names.define(p.name, target, self.place(p), None);
    }

    /// A pattern or texture: surfaces that it modifies are of the material before it.
    fn pattern(&mut self, p: &Primitive<'_>) {
        let caveat = format!("what {} `{}` does to its material isn't followed", p.kind, p.name);
        match self.names.find(p.modifier) {
            Some(target @ Target::Material(_)) => {
                self.names.define(p.name, target, self.place(p), Some(caveat));
            }
            _ => {
                let plain = self.names.plain(p.name);
                self.names.define_material(self.draft, plain, self.place(p), Some(caveat));
            }
        }
    }
}
