/// What became of a photon that was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// The sun doesn't reach its point on the PV, or its part of the sun's disc lies below the
    /// horizon or behind the PV's plane.
    Blocked,
    /// The PV took it, or it fell between what sampling allowed for and what the PV scatters.
    Absorbed,
    /// It landed on PV.
    OnPv,
    /// It is in the store.
    Stored,
    /// It left the scene.
    Escaped,
    /// It would have landed beyond the path limit.
    TooFar,
    /// It provably reaches nothing within the path limit, so it wasn't traced.
    NotSampled,
}

/// Photons and their flux.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Account {
    /// Number of photons.
    pub photons: u64,
    /// Their flux, W, summed over all timesteps.
    pub flux_w: f64,
}

/// Where all photons and all flux went. It closes: the photons exactly, the flux to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Tally {
    /// All that fell onto the PV's plane.
    pub sent: Account,
    /// See [`Fate::Blocked`].
    pub blocked: Account,
    /// See [`Fate::Absorbed`]. The flux is what the PV doesn't scatter, by its BSDF's integral.
    pub absorbed: Account,
    /// See [`Fate::OnPv`].
    pub on_pv: Account,
    /// See [`Fate::Stored`].
    pub stored: Account,
    /// See [`Fate::Escaped`].
    pub escaped: Account,
    /// See [`Fate::TooFar`].
    pub too_far: Account,
    /// See [`Fate::NotSampled`]. The flux is the rest of what the PV scatters, by its BSDF's
    /// integral: it also holds that integral's error and the noise of all others, so that it may
    /// lie a little below 0 where every direction lands.
    pub not_sampled: Account,
    /// Sum of the squares of the stored photons' flux, W2.
    pub stored_flux2_w2: f64,
    /// Rare numerical accidents: photons whose weight was above the bound that sampling assumed.
    /// Their flux is right; the store's flux ratio grows.
    pub over_bound: u64,
}

impl Tally {
    /// Books one photon that carried `left_w` away from the PV (0 if it never left). What fell
    /// onto the PV follows with [`Self::close`].
    pub fn book(&mut self, fate: Fate, left_w: f64) {
        self.sent.photons += 1;
        let account = match fate {
            Fate::Blocked => &mut self.blocked,
            Fate::Absorbed => &mut self.absorbed,
            Fate::OnPv => &mut self.on_pv,
            Fate::Stored => &mut self.stored,
            Fate::Escaped => &mut self.escaped,
            Fate::TooFar => &mut self.too_far,
            Fate::NotSampled => &mut self.not_sampled,
        };
        account.photons += 1;
        account.flux_w += left_w;
        if fate == Fate::Stored {
            self.stored_flux2_w2 += left_w * left_w;
        }
    }

    /// Completes the tally of photons that stand for `falls_w` on the PV, `scatters_w` of which it
    /// scatters: the rest is absorbed, and what no photon carried away was not sampled.
    pub fn close(&mut self, falls_w: f64, scatters_w: f64) {
        let carried_w: f64 = self.parts().iter().map(|a| a.flux_w).sum();
        self.sent.flux_w += falls_w;
        self.absorbed.flux_w += falls_w - scatters_w;
        self.not_sampled.flux_w += scatters_w - carried_w;
    }

    /// Adds another tally; the caller keeps a fixed order, because sums of floats depend on it.
    pub fn add(&mut self, other: &Self) {
        let pairs = [
            (&mut self.sent, &other.sent),
            (&mut self.blocked, &other.blocked),
            (&mut self.absorbed, &other.absorbed),
            (&mut self.on_pv, &other.on_pv),
            (&mut self.stored, &other.stored),
            (&mut self.escaped, &other.escaped),
            (&mut self.too_far, &other.too_far),
            (&mut self.not_sampled, &other.not_sampled),
        ];
        for (to, from) in pairs {
            to.photons += from.photons;
            to.flux_w += from.flux_w;
        }
        self.stored_flux2_w2 += other.stored_flux2_w2;
        self.over_bound += other.over_bound;
    }

    /// Photons sent less photons accounted for; 0 if the tally closes.
    pub fn missing_photons(&self) -> i128 {
        let found: u64 = self.parts().iter().map(|a| a.photons).sum();
        i128::from(self.sent.photons) - i128::from(found)
    }

    /// Flux that isn't accounted for, relative to what was sent.
    pub fn missing_flux(&self) -> f64 {
        let found: f64 = self.parts().iter().map(|a| a.flux_w).sum();
        if self.sent.flux_w == 0.0 {
            found.abs()
        } else {
            (self.sent.flux_w - found).abs() / self.sent.flux_w
        }
    }

    /// `(sum Phi)^2 / sum Phi^2` of the stored photons: how many photons of equal flux would be
    /// as noisy as these.
    pub fn effective_photons(&self) -> f64 {
        if self.stored_flux2_w2 == 0.0 {
            0.0
        } else {
            self.stored.flux_w * self.stored.flux_w / self.stored_flux2_w2
        }
    }

    fn parts(&self) -> [Account; 7] {
        [
            self.blocked,
            self.absorbed,
            self.on_pv,
            self.stored,
            self.escaped,
            self.too_far,
            self.not_sampled,
        ]
    }
}
