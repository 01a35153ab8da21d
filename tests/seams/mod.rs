//! Where rooms meet: same bytes whatever the threads, and the rules of the house.

mod determinism;
mod fused;
mod house;
mod keys;
mod maps;
mod memory;
mod photons;
mod resumed;
mod shards;
mod view_keys;
