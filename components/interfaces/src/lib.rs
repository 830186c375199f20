//! Interfaces between motorium graphs and people
