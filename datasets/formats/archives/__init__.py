"""Unpack archives from elsewhere: zip, tar and 7z, plain files only, nothing outside the folder given."""
