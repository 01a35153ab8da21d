//! The streaming glare analysis, held against SciPy (`tools/oracles/glare_reference.py`) and
//! against a slow twin of our own.

mod alike;
mod cases;
mod command;
mod large;
mod refused;
mod scipy;
mod session;
mod sparse;
mod spill;
mod twin;
mod uneven;
mod uneven_run;
mod volumes;
mod year;

use cases::{
    ALL, Case, Found, assert_same, plan, random_case, run, same_bits, shaped_cases, whole,
};
use command::program;
