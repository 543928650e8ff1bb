! A host that knows current coordinates alone: reads them with the time and calls the user subroutines as Abaqus does.
program host
  use, intrinsic :: iso_fortran_env, only: dp => real64
  implicit none
  integer :: d, k, i, input, output
  real(dp) :: head(2), time(2), coords(3), force, values(3), block_values(1), none(1, 3), cosines(1, 3, 3)
  real(dp), allocatable :: point(:)
  character(80) :: surface
  surface = " "
  none = 0
  cosines = 0
  open (newunit=input, file="points.bin", access="stream", form="unformatted", action="read")
  open (newunit=output, file="values.bin", access="stream", form="unformatted", action="write", status="replace")
  read (input) head
  d = nint(head(2))
  allocate (point(d + 1))
  do k = 1, nint(head(1))
    read (input) point
    coords = 0
    coords(1:d) = point(1:d)
    time = point(d + 1)
    do i = 1, d
      call dload(force, 1, 1, time, 1, 1, 0, 0, coords, i, surface)
      values(i) = force
    end do
    write (output) values(1:d)
    do i = 1, d
      block_values = 0
      call vdload(1, d, time(1), time(2), [1.0_dp], reshape(point(1:d), [1, d]), none(:, 1:d), &
        cosines(:, 1:d, 1:d), i, surface, block_values)
      values(i) = block_values(1)
    end do
    write (output) values(1:d)
  end do
end program
