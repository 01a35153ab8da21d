//! Where rooms meet: same bytes whatever the threads, and the rules of the house.

mod combinations;
mod determinism;
mod fused;
mod house;
mod keys;
mod maps;
mod memory;
mod mistakes;
mod photons;
mod products;
mod resumed;
mod shards;
mod view_keys;
