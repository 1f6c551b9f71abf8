//! Wavefront OBJ and MTL.
