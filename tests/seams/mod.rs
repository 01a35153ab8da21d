//! Where rooms meet: same bytes whatever the threads, and the rules of the house.

mod determinism;
mod fused;
mod house;
mod maps;
mod memory;
mod mistakes;
mod photons;
mod resumed;
mod shards;
