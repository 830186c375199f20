//! Physics for motorium: simulated robots and worlds
