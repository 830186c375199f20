//! Sensor models for motorium: noise, resolution, latency
