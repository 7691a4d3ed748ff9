-- Sets of (hologram, photograph) pairs, immutable once they have a digest.
create table dataset (
    id               text    not null primary key check (length(id) between 1 and 63),
    display          text    not null references display (id),
    wavelength_pm    integer not null check (wavelength_pm > 0),
    distance_nm      integer not null check (distance_nm <> 0),
    photo_encoding   text    not null check (photo_encoding in ('linear', 'srgb')),
    -- bits of the camera if the files have more; 0: the bits of the files
    photo_bit_depth  integer not null default 0 check (photo_bit_depth between 0 and 16),
    -- position of the display's pixels in the photographs; null: one camera pixel for each pixel of the display
    alignment        text    check (json_valid(alignment)),
    pair_count       integer not null default 0 check (pair_count >= 0),
    -- problems of the dataset as a whole
    findings         text    not null default '[]' check (json_valid(findings)),
    -- grows with every change; results computed from an older revision are refused
    revision         integer not null default 1 check (revision >= 1),
    digest           text,
    -- settings with which the dataset was finalized: fractions and seed of the split, and whether the alignment was
    -- kept
    finalization     text    check (json_valid(finalization)),
    -- numbers of the pairs by their use; null: the dataset is open
    split_counts     text    check (json_valid(split_counts)),
    create_time_ms   integer not null,
    finalize_time_ms integer,
    check ((digest is null) = (finalization is null)),
    check ((digest is null) = (finalize_time_ms is null))
) strict, without rowid;

create index dataset_by_display on dataset (display, id);

create trigger finalized_dataset_stays before update on dataset
when old.digest is not null
begin select raise(abort, 'the dataset is finalized'); end;

-- Pairs of datasets. A hologram or a photograph may be in only one pair of a dataset: a second partner would be a
-- mistake.
create table pair (
    -- the pairs of a deleted dataset go with it
    dataset  text not null references dataset (id) on delete cascade,
    id       text not null check (length(id) between 1 and 63),
    pattern  text not null references artifact (digest),
    photo    text not null references artifact (digest),
    -- use of the pair; null: not drawn yet, or (in a finalized dataset) left out
    split    text check (split in ('train', 'validation', 'test')),
    -- black level, exposure time and amplification; null: nothing is known
    exposure text check (json_valid(exposure)),
    -- measurements of the pair with the dataset's alignment; null: not measured yet
    checks   text check (json_valid(checks)),
    -- problems of the pair
    findings text not null default '[]' check (json_valid(findings)),
    primary key (dataset, id),
    unique (dataset, pattern),
    unique (dataset, photo)
) strict, without rowid;

create index pair_by_pattern on pair (pattern);
create index pair_by_photo on pair (photo);

create trigger pair_of_finalized_dataset_stays before update on pair
when (select digest from dataset where id = old.dataset) is not null
begin select raise(abort, 'the dataset is finalized'); end;

create trigger pair_of_finalized_dataset_is_kept before delete on pair
when (select digest from dataset where id = old.dataset) is not null
begin select raise(abort, 'the dataset is finalized'); end;

create trigger finalized_dataset_takes_no_pair before insert on pair
when (select digest from dataset where id = new.dataset) is not null
begin select raise(abort, 'the dataset is finalized'); end;
