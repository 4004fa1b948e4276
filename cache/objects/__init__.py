"""A cache in an object store: S3, GCS, Azure, or the memory of this process.

::

    PREFIX/records/ab/KEY.json      makes the entry exist: the record, and the place of its data
    PREFIX/data/LEASE/HASH/         manifest.json and data.zarr/, the place of one draft; invisible without a record
    PREFIX/drafts/LEASE/HASH        a draft that is neither published nor deleted: its key, and the names of its arrays
    PREFIX/leases/LEASE/alive       a run that is alive: it writes this again every few seconds
    PREFIX/leases/LEASE/keys/...    keys that it uses, or used: the time of the object says when
    PREFIX/claims/KEY               who makes a key, by its lease
    PREFIX/cleaning                 the keys that a cleaning is about to delete
    PREFIX/sources/HASH.py          the text of each module that made an entry
    PREFIX/checkpoints/KEY          states of long work, until its product is there
    PREFIX/CACHE.TAG                makes the prefix a cache

How an entry comes to exist: data first, record last, and nothing is renamed.

1. each chunk is created under the draft's own prefix, its sha256 beside it as an attribute;
2. the manifest is created from these; a draft that is given up gets a mark in its place, and whoever creates the
   object first decides which of the two it is;
3. the record is created, if it is absent: now the entry exists.

Drafts, claims, checkpoints, ``alive``, ``cleaning`` and the record of a damaged entry are replaced. Everything else is
written once, by a PUT that fails if the object is there: whoever meets an object compares it with his own. So each
request can be sent again, and an answer that was lost costs a comparison. What is published never depends on a list:
lists find what can be cleaned, and may come late.
"""
