//! What several fuzz targets share.

pub mod device;
pub mod lens;
