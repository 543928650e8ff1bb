! Calls the user subroutine as CalculiX does, at reference coordinates.
program host
  use, intrinsic :: iso_fortran_env, only: dp => real64
  implicit none
  integer, parameter :: d = DIMENSION
  real(dp) :: count, point(d + 1), time(2), coords(3), values(d), none(3), rho
  integer :: k, i, input, output, whole(4), iscale
  none = 0
  whole = 0
  rho = 0
  iscale = 1
  open (newunit=input, file="points.bin", access="stream", form="unformatted", action="read")
  open (newunit=output, file="values.bin", access="stream", form="unformatted", action="write", status="replace")
  read (input) count
  do k = 1, nint(count)
    read (input) point
    coords = 0
    coords(1:d) = point(1:d)
    time = point(d + 1)
    do i = 1, d
      call dload(values(i), 1, 1, time, 1, 1, 0, 0, coords, i, "BXNU                ", none, none, "C3D8    ", whole, &
        whole, whole, none, 0, whole, whole, iscale, none, rho, repeat(" ", 80), whole)
    end do
    write (output) values
  end do
end program
