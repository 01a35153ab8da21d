//! How PV scatters light.
