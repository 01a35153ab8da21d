use glam::Vec3;

/// A photon where it landed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Where it landed, metres from the local origin.
    pub position: Vec3,
    /// Unit normal of the receiver, turned to the side that the light came from.
    pub normal: Vec3,
    /// Unit vector from the receiver back to where the light came from.
    pub direction: Vec3,
    /// Flux in watts, in the timestep's own hour: not weighted by its duration.
    pub flux_w: f32,
    /// Index of the timestep whose sun it comes from.
    pub timestep: u32,
    /// The PV surface that sent it.
    pub surface: u16,
}
