/// What arrives at one receiver, by timestep. Only timesteps in `lit` are not 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DirectYear {
    /// Irradiance of the surface, W/m2, by timestep.
    pub surface_w_m2: Vec<f64>,
    /// Irradiance of planes that face the beams (E_n), W/m2, by timestep.
    pub normal_w_m2: Vec<f64>,
    /// Bound of the error in `surface_w_m2`, W/m2, by timestep.
    pub error_w_m2: Vec<f64>,
    /// Timesteps that are lit, in the order in which they were met.
    pub lit: Vec<u32>,
}

impl DirectYear {
    pub(super) fn clear(&mut self, timesteps: usize) {
        for list in [&mut self.surface_w_m2, &mut self.normal_w_m2, &mut self.error_w_m2] {
            // A year has many timesteps, of which a receiver sees some.
            for &step in &self.lit {
                list[step as usize] = 0.0;
            }
            list.resize(timesteps, 0.0);
        }
        self.lit.clear();
    }

    #[inline]
    pub(super) fn add(&mut self, step: u32, surface: f64, normal: f64, error: f64) {
        if normal > 0.0 {
            let i = step as usize;
            if self.normal_w_m2[i] == 0.0 {
                self.lit.push(step);
            }
            self.surface_w_m2[i] += surface;
            self.normal_w_m2[i] += normal;
            self.error_w_m2[i] += error;
        }
    }
}
