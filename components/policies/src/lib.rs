//! Policies for motorium: movement primitives
